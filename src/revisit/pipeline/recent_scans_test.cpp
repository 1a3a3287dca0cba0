// SPDX-License-Identifier: Apache-2.0
#include <revisit/pipeline/recent_scans.hpp>

#include <gtest/gtest.h>

namespace revisit {
namespace {

// One point, 10 m ahead of where the drive began.
PreparedScan scan_at(double x_m, double yaw_rad, int origin = 0) {
  PreparedScan scan;
  const Pose T_segment_lidar = planar_pose(x_m, 0.0, yaw_rad);
  const Eigen::Vector3d p = T_segment_lidar.inverse() * Eigen::Vector3d(10.0, 0.0, 1.0);
  scan.scan.points = {{static_cast<float>(p.x()), static_cast<float>(p.y()), static_cast<float>(p.z()), 0.5f}};
  scan.trajectory_point.emplace();
  scan.trajectory_point->T_segment_lidar = T_segment_lidar;
  scan.trajectory_point->origin = origin;
  return scan;
}

TEST(RecentScans, AreLaidTogetherInTheFrameOfTheLast) {
  RecentScans recent(3);
  for (int i = 0; i < 5; ++i) recent.add(scan_at(1.0 * i, 0.3 * i));
  const auto last = scan_at(4.0, 1.2).scan.points.front();
  const auto points = recent.together(10);
  ASSERT_EQ(points.size(), 3u);
  for (const Point& p : points) {
    EXPECT_NEAR(p.x, last.x, 1e-4);
    EXPECT_NEAR(p.y, last.y, 1e-4);
    EXPECT_NEAR(p.z, 1.0, 1e-4);
    EXPECT_FLOAT_EQ(p.intensity, 0.5f);
  }
  EXPECT_EQ(recent.together(2).size(), 2u);
}

TEST(RecentScans, ForgetWhatCameBeforeOdometryBeganAnew) {
  RecentScans recent(3);
  recent.add(scan_at(0.0, 0.0));
  recent.add(scan_at(0.0, 0.0, 1));
  EXPECT_EQ(recent.together(3).size(), 1u);
}

TEST(RecentScans, BeforeTheLastAreThoseOfItsTimeItsSurroundingsAndItsSegment) {
  const auto before_last = [](double x_m, double stamp_s, int segment) {
    RecentScans recent(3);
    PreparedScan earlier = scan_at(x_m, 0.3);
    earlier.scan.stamp_s = stamp_s;
    earlier.trajectory_point->segment = segment;
    earlier.ground.is_ground = {1};
    recent.add(earlier);
    PreparedScan last = scan_at(0.0, 0.0);
    last.scan.stamp_s = 10.0;
    recent.add(last);
    return recent.before_last(1.0, 3.0);
  };
  const auto found = before_last(2.5, 9.5, 0);
  ASSERT_EQ(found.points.size(), 1u);
  EXPECT_NEAR(found.points.front().x, 10.0, 1e-4);
  EXPECT_EQ(found.is_ground, std::vector<std::uint8_t>{1});
  EXPECT_TRUE(before_last(3.5, 9.5, 0).points.empty()) << "too far away";
  EXPECT_TRUE(before_last(2.5, 8.5, 0).points.empty()) << "too long ago";
  EXPECT_TRUE(before_last(2.5, 9.5, 1).points.empty()) << "odometry was lost in between";
}

}  // namespace
}  // namespace revisit
