// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include <revisit/core/scan.hpp>
#include <revisit/core/twist.hpp>

namespace revisit {

/// Undoes the motion of the sensor during its sweep: every point comes to stand where it would have been seen at the
/// scan's stamp. Needs the time of each point; without them the scan is left as it is.
void undistort(Scan& scan, const Twist& motion);
/// The points of the scan as undistort() would place them; the scan stays as it was swept.
std::vector<Point> compensated(const Scan& scan, const Twist& motion);

/// Gives the points of a scan that has no times those of a sensor that turns evenly, once in `sweep_s` seconds, and
/// looks straight ahead at the stamp. Seen from above it turns clockwise, or the other way round where `sweep_s` is
/// negative. A scan that has times, or 0 seconds, is left as it is.
void assume_sweep(Scan& scan, double sweep_s);

}  // namespace revisit
