// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <revisit/core/scan.hpp>
#include <revisit/core/twist.hpp>

namespace revisit {

/// Undoes the motion of the sensor during its sweep: every point comes to stand where it would have been seen at the
/// scan's stamp. Needs the time of each point; without them the scan is left as it is.
void undistort(Scan& scan, const Twist& motion);

}  // namespace revisit
