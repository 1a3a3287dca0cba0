// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <revisit/core/pose.hpp>
#include <revisit/registration/icp.hpp>

namespace revisit {

/// What carries a sensor brakes and jolts only so hard: how far a scan may lie from where the motion so far predicts
/// it. Scans slide along what hardly fixes them, a wall or a corridor.
class MotionLimits {
 public:
  /// `untracked_s`: since the last scan that was tracked.
  MotionLimits(const Pose& T_map_predicted, double untracked_s);

  /// Whether a pose lies farther off than can be along directions that its scan hardly fixes.
  bool slides(const IcpResult& found) const;
  /// Whether it lies near the prediction in every direction, and is turned by little.
  bool is_near(const IcpResult& found) const;

 private:
  Pose surprise(const IcpResult& found) const { return T_map_predicted_.inverse() * found.T_target_source; }

  Pose T_map_predicted_;
  double most_m_;
};

}  // namespace revisit
