// SPDX-License-Identifier: Apache-2.0
#include <revisit/odometry/motion_limits.hpp>

#include <gtest/gtest.h>

namespace revisit {
namespace {

// Found so far from the predicted pose, by a scan of which so much fixes x, y and z.
IcpResult found(const Pose& T_predicted_lidar, const Eigen::Vector3d& fixes) {
  IcpResult icp;
  icp.T_target_source = planar_pose(100.0, 50.0, 1.0) * T_predicted_lidar;
  icp.information.setIdentity();
  icp.information.topLeftCorner<3, 3>() = fixes.asDiagonal();
  return icp;
}

const MotionLimits kAfterOneScan(planar_pose(100.0, 50.0, 1.0), 0.1);
const Eigen::Vector3d kAlongACorridor(30.0, 1000.0, 1000.0), kInAYard(600.0, 1000.0, 1000.0);

TEST(MotionLimits, ALeapAlongWhatHardlyFixesItSlides) {
  const Pose leap = planar_pose(0.5, 0.0, 0.0), step = planar_pose(0.1, 0.0, 0.0), across = planar_pose(0.0, 0.5, 0.0);
  EXPECT_TRUE(kAfterOneScan.slides(found(leap, kAlongACorridor)));
  EXPECT_FALSE(kAfterOneScan.slides(found(step, kAlongACorridor)));
  EXPECT_FALSE(kAfterOneScan.slides(found(across, kAlongACorridor))) << "the walls fix it";
  EXPECT_FALSE(kAfterOneScan.slides(found(leap, kInAYard)));
  EXPECT_FALSE(MotionLimits(planar_pose(100.0, 50.0, 1.0), 0.5).slides(found(leap, kAlongACorridor)))
      << "half a second later it may have braked";
}

TEST(MotionLimits, NearIsNearInEveryDirection) {
  EXPECT_TRUE(kAfterOneScan.is_near(found(planar_pose(0.1, 0.0, to_radians(10.0)), kInAYard)));
  EXPECT_FALSE(kAfterOneScan.is_near(found(planar_pose(0.0, 0.3, 0.0), kInAYard)));
  EXPECT_FALSE(kAfterOneScan.is_near(found(planar_pose(0.0, 0.0, to_radians(20.0)), kInAYard)));
}

}  // namespace
}  // namespace revisit
