// SPDX-License-Identifier: Apache-2.0
#include <revisit/odometry/last_view.hpp>

#include <vector>

#include <gtest/gtest.h>

#include <revisit/odometry/local_map.hpp>

namespace revisit {
namespace {

// A wall across the view, so many metres ahead.
std::vector<Eigen::Vector3f> wall(float x, float y_from, float y_to, float half_height = 1.f) {
  std::vector<Eigen::Vector3f> points;
  for (float y = y_from; y < y_to; y += 0.1f)
    for (float z = -half_height; z < half_height; z += 0.1f) points.emplace_back(x, y, z);
  return points;
}

class LastViewOfAWall : public testing::Test {
 protected:
  LastViewOfAWall() {
    map.add(wall(10.f, -5.f, 5.f));
    view.set(wall(10.f, -5.f, 5.f), Pose::Identity());
  }
  double contradicted(const std::vector<Eigen::Vector3f>& points, const Pose& T_odom_lidar = Pose::Identity()) const {
    return view.contradicted(map, points, T_odom_lidar, 1.0);
  }
  LocalMap map{1.0, 50.0};
  LastView view;
};

TEST_F(LastViewOfAWall, WhatMeetsTheMapOrLiesWhereNobodyLookedIsNotContradicted) {
  EXPECT_DOUBLE_EQ(contradicted(wall(10.f, -4.f, 4.f)), 0.0) << "the same wall";
  EXPECT_DOUBLE_EQ(contradicted(wall(10.f, 8.f, 15.f)), 0.0) << "beside what was seen";
  EXPECT_DOUBLE_EQ(contradicted(wall(20.f, -4.f, 4.f)), 0.0) << "behind the wall";
  EXPECT_DOUBLE_EQ(contradicted({}), 0.0);
}

TEST_F(LastViewOfAWall, WhatStandsWhereItSawThroughIsContradicted) {
  EXPECT_GT(contradicted(wall(5.f, -2.f, 2.f, 0.4f)), 0.99);
  EXPECT_GT(contradicted(wall(10.f, -2.f, 2.f, 0.4f), planar_pose(-5.0, 0.0, 0.0)), 0.99) << "seen from a wrong pose";
}

}  // namespace
}  // namespace revisit
