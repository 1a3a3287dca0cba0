// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <revisit/config/parameters.hpp>
#include <revisit/core/scan.hpp>

namespace revisit {

/// Drops the points nearer than min_range_m or farther than max_range_m (3-D distance from the sensor), in place and in
/// order, with their rings and times (paper, section III-A). What drivers mark as "no return" goes too: NaN, infinite
/// coordinates and (0,0,0); an intensity that is no number becomes 0. One pass, no allocation.
/// What is kept is turned upwards by elevation_offset_deg, about the sensor.
void filter_range(Scan& scan, const PreprocessOptions& options);

}  // namespace revisit
