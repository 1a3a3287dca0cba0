// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <optional>

#include <revisit/core/pose.hpp>

namespace revisit {

/// Table 3: how far a trajectory is from the truth (docs/evaluation.md).
struct TrajectoryTable {
  std::size_t frames = 0;                        ///< with a pose in both
  double length_m = 0.0;                         ///< of the reference, along these frames
  double ate_m = 0.0, worst_m = 0.0;             ///< absolute trajectory error: RMSE and maximum after SE(3) alignment
  Pose T_reference_estimate = Pose::Identity();  ///< the alignment
  /// KITTI's relative error over 100, 200, ... 800 m; none where the drive is shorter than 100 m.
  std::optional<double> relative_percent, relative_deg_per_m;
};

/// Frames that are not in both are left out. Fewer than two leave nothing to say: all zero.
TrajectoryTable evaluate_trajectory(const Trajectory& estimate, const Trajectory& reference);

}  // namespace revisit
