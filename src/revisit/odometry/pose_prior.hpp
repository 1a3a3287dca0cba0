// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include <revisit/odometry/track_state.hpp>
#include <revisit/registration/icp.hpp>

namespace revisit {

/// Where a scan is thought to be in the map before it is compared. Where few surfaces fix a pose, how the sensor moved
/// so far tells more of its position, and an IMU of its rotation. None where nothing is known.
std::optional<PosePrior> pose_prior(const TrackState& track, const MatcherScan& scan, double stamp_s,
                                    const ScanMatch& predicted);

}  // namespace revisit
