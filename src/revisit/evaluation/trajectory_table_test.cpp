// SPDX-License-Identifier: Apache-2.0
#include <revisit/evaluation/trajectory_table.hpp>

#include <gtest/gtest.h>

namespace revisit {
namespace {

// Straight on, a metre a frame.
Trajectory straight(int frames, double metre = 1.0) {
  Trajectory trajectory;
  for (int i = 0; i < frames; ++i) trajectory.entries[{i}] = {0.1 * i, planar_pose(metre * i, 0, 0)};
  return trajectory;
}

TEST(TrajectoryTable, WhereItStartsAndHeadsDoesNotMatter) {
  Trajectory moved = straight(300), bent = straight(300);
  Pose T = planar_pose(30, -20, 1.0);
  T.rotate(Eigen::AngleAxisd(0.2, Eigen::Vector3d::UnitX()));
  for (int i = 0; i < 300; ++i) bent.entries[{i}].T_world_lidar = planar_pose(i, 0.001 * i * i, 0.002 * i);
  for (auto& [frame, entry] : moved.entries) entry.T_world_lidar = T * bent.entries[frame].T_world_lidar;
  const TrajectoryTable table = evaluate_trajectory(moved, bent);
  EXPECT_EQ(table.frames, 300u);
  EXPECT_NEAR(table.ate_m, 0.0, 1e-9);
  EXPECT_NEAR(*table.relative_percent, 0.0, 1e-9);
  EXPECT_TRUE(table.T_reference_estimate.isApprox(T.inverse(), 1e-9));
}

TEST(TrajectoryTable, TooLongByAHundredth) {
  const TrajectoryTable table = evaluate_trajectory(straight(301, 1.01), straight(301));
  EXPECT_NEAR(table.length_m, 300.0, 1e-9);
  EXPECT_NEAR(table.worst_m, 1.5, 1e-9) << "3 m too long, shared by both ends";
  EXPECT_NEAR(table.ate_m, 3.0 / std::sqrt(12.0), 0.01) << "an even spread over 3 m";
  // From each frame to the first that lies more than 100 m further: 101 m.
  EXPECT_NEAR(*table.relative_percent, 1.0075, 0.01);
  EXPECT_NEAR(*table.relative_deg_per_m, 0.0, 1e-9);
}

TEST(TrajectoryTable, FramesWithoutAPartnerAndShortDrives) {
  Trajectory estimate = straight(50);
  estimate.entries.erase({7});
  estimate.entries[{900}] = {90.0, planar_pose(1e6, 0, 0)};
  const TrajectoryTable table = evaluate_trajectory(estimate, straight(60));
  EXPECT_EQ(table.frames, 49u);
  EXPECT_NEAR(table.ate_m, 0.0, 1e-9);
  EXPECT_FALSE(table.relative_percent);
  EXPECT_EQ(evaluate_trajectory({}, straight(60)).frames, 0u);
}

}  // namespace
}  // namespace revisit
