// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include <revisit/config/parameters.hpp>
#include <revisit/core/pose.hpp>
#include <revisit/core/refusal.hpp>
#include <revisit/core/result.hpp>
#include <revisit/core/scan.hpp>

namespace revisit {

/// How two scans lie to each other.
struct Registration {
  Pose T_target_source = Pose::Identity();  ///< maps the source's LiDAR frame into the target's, metres
  Matrix6 information = Matrix6::Zero();    ///< of the pose, as in LoopConstraint
  double probability = 0.0;                 ///< that the pose is right (docs/accuracy.md)
  double inlier_ratio = 0.0;                ///< the smaller of both directions, [0, 1]
  double rmse_m = 0.0;                      ///< point-to-plane, over the inliers
  std::optional<Refusal> refusal;           ///< why the pose is not to be trusted; absent where it is

  bool is_accepted() const { return !refusal; }
};

/// Registers two scans of any sensor without a guess: up to some 10 m apart, with any heading. The scans come as a
/// driver delivers them; where their points carry times, the motion during each sweep is found and undone. Believes
/// that both show one place: rooms and aisles that look alike cannot be told apart (docs/accuracy.md). An error where
/// one of them describes no place. Deterministic; safe to call from several threads.
Result<Registration> register_scans(const Scan& source, const Scan& target, const Parameters& parameters = {});

}  // namespace revisit
