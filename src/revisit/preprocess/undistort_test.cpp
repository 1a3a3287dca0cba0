// SPDX-License-Identifier: Apache-2.0
#include <revisit/preprocess/undistort.hpp>

#include <gtest/gtest.h>

namespace revisit {
namespace {

TEST(Twist, LeadsWhereItCameFrom) {
  Pose T = planar_pose(1.3, 0.2, 0.1);
  T.translation().z() = 0.05;
  const Pose again = motion_after(twist_of(T, 0.1), 0.1);
  EXPECT_LT((again.translation() - T.translation()).norm(), 1e-3);
  EXPECT_LT(rotation_angle(again.inverse() * T), 1e-9);
  EXPECT_TRUE(motion_after({}, 1.0).isApprox(Pose::Identity()));
  EXPECT_EQ(twist_of(Pose::Identity(), 0.1).linear_mps.norm(), 0.0);
}

TEST(Undistort, PutsPointsWhereTheyAreSeenFromTheStamp) {
  Twist motion;
  motion.linear_mps = {14.0, 0.5, 0.0};
  motion.angular_radps = {0.0, 0.02, 0.6};
  Scan distorted, still;
  for (int i = 0; i < 400; ++i) {
    const double time_s = -0.05 + 0.1 * i / 399.0, angle = 0.1 * i;
    const Eigen::Vector3d at_stamp(30.0 * std::cos(angle), 30.0 * std::sin(angle), 2.0);
    const Eigen::Vector3d seen = motion_after(motion, time_s).inverse() * at_stamp;
    still.points.push_back({static_cast<float>(at_stamp.x()), static_cast<float>(at_stamp.y()), 2.f, 0.5f});
    distorted.points.push_back(
        {static_cast<float>(seen.x()), static_cast<float>(seen.y()), static_cast<float>(seen.z()), 0.5f});
    distorted.times_s.push_back(static_cast<float>(time_s));
  }
  Scan without_times = distorted;
  without_times.times_s.clear();
  undistort(without_times, motion);
  EXPECT_EQ(without_times.points[0].x, distorted.points[0].x) << "without times nothing is undone";
  undistort(distorted, motion);
  for (std::size_t i = 0; i < still.points.size(); ++i) {
    EXPECT_NEAR(distorted.points[i].x, still.points[i].x, 5e-3f) << i;
    EXPECT_NEAR(distorted.points[i].y, still.points[i].y, 5e-3f) << i;
    EXPECT_NEAR(distorted.points[i].z, still.points[i].z, 5e-3f) << i;
  }
}

TEST(AssumeSweep, AClockwiseSensorLooksLeftBeforeItLooksAhead) {
  Scan scan;
  scan.points = {{10, 0, 0, 0}, {0, 10, 0, 0}, {0, -10, 0, 0}, {-10, -1e-3f, 0, 0}};
  Scan other = scan;
  assume_sweep(scan, 0.1);
  ASSERT_EQ(scan.times_s.size(), 4u);
  EXPECT_NEAR(scan.times_s[0], 0.f, 1e-6f);
  EXPECT_NEAR(scan.times_s[1], -0.025f, 1e-6f);
  EXPECT_NEAR(scan.times_s[2], 0.025f, 1e-6f);
  EXPECT_NEAR(scan.times_s[3], 0.05f, 1e-4f);
  assume_sweep(other, -0.1);
  EXPECT_NEAR(other.times_s[1], 0.025f, 1e-6f);
  assume_sweep(other, 0.1);
  EXPECT_NEAR(other.times_s[1], 0.025f, 1e-6f) << "times that are there stay";
  Scan none;
  none.points = {{1, 2, 3, 0}};
  assume_sweep(none, 0.0);
  EXPECT_TRUE(none.times_s.empty());
}

}  // namespace
}  // namespace revisit
