// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <revisit/core/scan.hpp>

namespace revisit {

enum class RingSource {
  kFile,       ///< the file names the ring of each point
  kOrder,      ///< points are stored ring after ring, each a turn of azimuth (KITTI)
  kElevation,  ///< the elevation angles gather on lines
  kNone,       ///< no rings: a non-repetitive sensor, or a scan merged from several poses
};

std::string to_string(RingSource source);

/// The laser rings of a scan, numbered from the lowest (0) to the highest elevation.
struct Rings {
  RingSource source = RingSource::kNone;
  std::vector<std::uint16_t> of_point;  ///< one a point, empty without rings
  std::vector<float> elevations_rad;    ///< mean elevation of each ring, increasing
  std::size_t count() const { return elevations_rad.size(); }
};

/// Finds the rings from the file, else from the order of the points, else from their elevation angles.
/// Linear in the number of points; a few milliseconds for 120,000.
Rings find_rings(const Scan& scan);

/// Numbers the rings the other way round: those of a sensor that hangs upside down.
void turn_over(Rings& rings);

}  // namespace revisit
