// SPDX-License-Identifier: Apache-2.0
#include <revisit/odometry/starts_in_a_gap.hpp>

#include <cmath>

namespace revisit {
namespace {

struct Spread {
  static constexpr double kTurnStep_deg = 10.0, kLikelyTurn_deg = 20.0, kMostTurn_deg = 120.0;
  static constexpr double kFastest_mps = 20.0, kStep_m = 2.0;
  static constexpr int kDirections = 12;
};

}  // namespace

StartsInAGap StartsInAGap::after(double gap_s, const Pose& T_previous_predicted, const std::optional<Twist>& motion) {
  StartsInAGap starts;
  starts.likely = {Pose::Identity(), Pose(Eigen::Translation3d(T_previous_predicted.translation()))};
  std::vector<Pose> turned = {motion ? motion_after(*motion, 0.5 * gap_s) : Pose::Identity()};
  if (T_previous_predicted.translation().norm() > Spread::kStep_m) turned.push_back(T_previous_predicted);
  for (double turn_deg = 0.0; turn_deg <= Spread::kMostTurn_deg; turn_deg += Spread::kTurnStep_deg)
    for (const Pose& T : turned) {
      std::vector<Pose>& these = turn_deg <= Spread::kLikelyTurn_deg ? starts.likely : starts.unlikely;
      these.push_back(T * planar_pose(0.0, 0.0, to_radians(turn_deg)));
      if (turn_deg > 0.0) these.push_back(T * planar_pose(0.0, 0.0, to_radians(-turn_deg)));
    }
  return starts;
}

StartsInAGap StartsInAGap::of_second_scan(double gap_s) {
  StartsInAGap starts;
  for (double far_m = Spread::kStep_m; far_m <= Spread::kFastest_mps * gap_s; far_m += Spread::kStep_m)
    for (int i = 0; i < Spread::kDirections; ++i) {
      const double angle_rad = 2.0 * kPi * i / Spread::kDirections;
      starts.likely.push_back(planar_pose(far_m * std::cos(angle_rad), far_m * std::sin(angle_rad), 0.0));
    }
  return starts;
}

}  // namespace revisit
