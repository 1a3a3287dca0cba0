// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include <revisit/core/pose.hpp>
#include <revisit/core/scan.hpp>
#include <revisit/core/twist.hpp>
#include <revisit/registration/surface.hpp>

namespace revisit {

/// The motion during the sweep of a scan whose points carry times, seen from a surface on which the scan lies at about
/// the guess: pose and motion together lay the points on it, point to plane. For a scan that comes alone; where
/// odometry follows the sensor, it knows better. Nothing where the points have no times, too few of them meet the
/// surface, or the motion is above 3 m/s among walls (not `in_the_open`): it would make a wrong heading fit.
/// Deterministic.
struct SweepMotion {
  Pose T_target_source = Pose::Identity();  ///< at the scan's stamp
  Twist motion;
};
std::optional<SweepMotion> find_sweep_motion(const Surface& target, const Scan& scan, const Pose& T_guess_target_source,
                                             bool in_the_open);

}  // namespace revisit
