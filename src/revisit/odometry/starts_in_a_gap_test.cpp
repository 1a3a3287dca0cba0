// SPDX-License-Identifier: Apache-2.0
#include <revisit/odometry/starts_in_a_gap.hpp>

#include <algorithm>

#include <gtest/gtest.h>

namespace revisit {
namespace {

// How far the nearest of them lies from a pose.
double nearest_m(const std::vector<Pose>& starts, const Pose& T, double most_turn_deg) {
  double nearest = 1e9;
  for (const Pose& each : starts) {
    const Pose off = each.inverse() * T;
    if (rotation_angle(off) <= to_radians(most_turn_deg)) nearest = std::min(nearest, off.translation().norm());
  }
  return nearest;
}

TEST(StartsInAGap, ACarThatGoesStraightOnOrStopsOrTurns) {
  const Twist bend{{8.0, 0.0, 0.0}, {0.0, 0.0, to_radians(30.0)}};
  const Pose T_predicted = motion_after(bend, 0.5);
  const StartsInAGap starts = StartsInAGap::after(0.5, T_predicted, bend);
  EXPECT_LT(nearest_m(starts.likely, Pose::Identity(), 1.0), 0.1) << "it stopped";
  EXPECT_LT(nearest_m(starts.likely, planar_pose(T_predicted.translation().x(), 0.5, 0.0), 1.0), 0.6) << "straight on";
  EXPECT_LT(nearest_m(starts.likely, planar_pose(2.0, 0.0, to_radians(-10.0)), 5.1), 0.5);
  EXPECT_GT(nearest_m(starts.likely, planar_pose(2.0, 0.0, to_radians(-60.0)), 5.1), 1e8);
  EXPECT_LT(nearest_m(starts.unlikely, planar_pose(2.0, 0.0, to_radians(-60.0)), 5.1), 0.5);
  EXPECT_LT(nearest_m(starts.unlikely, planar_pose(2.0, 0.0, to_radians(120.0)), 10.0), 0.5);
}

TEST(StartsInAGap, NothingIsKnownOfTheMotionBefore) {
  const StartsInAGap starts = StartsInAGap::after(1.0, Pose::Identity(), std::nullopt);
  for (const double turn_deg : {0.0, 20.0, -20.0})
    EXPECT_LT(nearest_m(starts.likely, planar_pose(0.0, 0.0, to_radians(turn_deg)), 0.1), 1e-9);
}

TEST(StartsInAGap, ASecondScanAsFarAsACarGets) {
  const StartsInAGap starts = StartsInAGap::of_second_scan(0.5);
  for (const Pose& T : {planar_pose(6.0, 0.5, 0.0), planar_pose(-9.0, 1.0, 0.0), planar_pose(0.0, -3.0, 0.0)})
    EXPECT_LT(nearest_m(starts.likely, T, 1.0), 2.5);
  EXPECT_GT(nearest_m(starts.likely, planar_pose(14.0, 0.0, 0.0), 1.0), 3.0);
  EXPECT_TRUE(StartsInAGap::of_second_scan(0.05).likely.empty());
}

}  // namespace
}  // namespace revisit
