// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <revisit/config/parameters.hpp>
#include <revisit/core/scan.hpp>
#include <revisit/preprocess/rings.hpp>

namespace revisit {

/// Which points lie on the ground, and how that was found.
struct GroundSegmentation {
  std::vector<std::uint8_t> is_ground;   ///< one a point, 0 or 1
  RingSource rings = RingSource::kNone;  ///< kNone: the polar-grid fallback, for sensors without rings
  std::size_t ring_count = 0;
};

/// Ground as in LeGO-LOAM (paper, section III-A): in the range image (row = ring, column = azimuth), two vertically
/// neighbouring returns are ground where the slope between them is at most ground_slope_deg; patches of fewer than
/// ground_min_segment_points are not ground. Sensors without rings fall back to a polar grid of lowest points, walked
/// outward with the same slope. Assumes that z points up within the slope. `rings` come from find_rings(scan).
GroundSegmentation segment_ground(const Scan& scan, const Rings& rings, const PreprocessOptions& options);

}  // namespace revisit
