// SPDX-License-Identifier: Apache-2.0
#include <revisit/preprocess/upright.hpp>

#include <gtest/gtest.h>

#include <revisit/core/pose.hpp>

#include "synthetic_world.hpp"

namespace revisit {
namespace {

using testing_support::SyntheticWorld;

const Eigen::Vector3f kStraight = Eigen::Vector3f::UnitZ();

Pose tilted(const Eigen::Vector3d& axis, double tilt_deg) {
  Pose T = SyntheticWorld::at(0, 0, 0.3);
  T.rotate(Eigen::AngleAxisd(to_radians(tilt_deg), axis.normalized()));
  return T;
}

TEST(FindUp, IsTheNormalOfTheGroundUnderATiltedSensor) {
  const SyntheticWorld world(51);
  for (const Eigen::Vector3d& axis : {Eigen::Vector3d(1, 0, 0), Eigen::Vector3d(0, -1, 0), Eigen::Vector3d(1, 2, 0)})
    for (const double tilt_deg : {9.5, 15.0, 30.0}) {
      const Pose T_world_lidar = tilted(axis, tilt_deg);
      const Eigen::Vector3f up = find_up(world.scan(T_world_lidar, {16, 900, -15.0, 15.0}).points);
      const Eigen::Vector3d truth = T_world_lidar.linear().transpose() * Eigen::Vector3d::UnitZ();
      const double off = up.cast<double>().cross(truth).norm();
      EXPECT_LT(off, std::sin(to_radians(1.5))) << tilt_deg << " deg about " << axis.transpose();
      EXPECT_NEAR(up.norm(), 1.f, 1e-5f);
      EXPECT_GT((upright_pose(up) * truth).z(), std::cos(to_radians(1.5)));
    }
}

TEST(FindUp, IsStraightWhereTheSensorIsLevelOrNoGroundIsSeen) {
  const SyntheticWorld world(51);
  EXPECT_EQ(find_up(world.scan(tilted({1, 0, 0}, 5.0), {16, 900, -15.0, 15.0}).points), kStraight) << "as a car rolls";
  EXPECT_EQ(find_up({}), kStraight);
  testing::internal::CaptureStderr();
  std::vector<Point> line, wall, ceiling;
  for (int i = 0; i < 400; ++i) {
    const auto along = 0.05f * static_cast<float>(i), across = 0.3f * static_cast<float>(i % 20);
    line.push_back({along - 10.f, 2.f, 0.3f * along - 5.f, 1.f});
    wall.push_back({4.f, across - 3.f, 0.2f * along - 1.f, 1.f});
    ceiling.push_back({across - 3.f, along - 10.f, 3.f + 0.2f * along, 1.f});
  }
  EXPECT_EQ(find_up(line), kStraight);
  EXPECT_EQ(find_up(wall), kStraight);
  EXPECT_EQ(find_up(ceiling), kStraight) << "the sensor stands above the ground";
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
  EXPECT_EQ(upright_pose(kStraight).matrix(), Pose::Identity().matrix());
}

TEST(FindUp, TheSamePointsGiveTheSameAnswer) {
  const Scan scan = SyntheticWorld(51).scan(tilted({1, 0, 0}, 12.0), {16, 900, -15.0, 15.0});
  EXPECT_EQ(find_up(scan.points), find_up(scan.points));
}

}  // namespace
}  // namespace revisit
