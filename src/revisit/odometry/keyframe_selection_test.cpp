// SPDX-License-Identifier: Apache-2.0
#include <revisit/odometry/keyframe_selection.hpp>

#include <gtest/gtest.h>

#include "synthetic_world.hpp"

namespace revisit {
namespace {

using testing_support::SyntheticWorld;

std::vector<Point> view_from(const Pose& T_world_lidar) {
  return SyntheticWorld(31).scan(T_world_lidar, {32, 600, -24.8, 5.0}).points;
}

TEST(KeyframeSelection, ADistanceOrATurnMakesAKeyframe) {
  const Pose T_start = SyntheticWorld::at(0, 0, 0);
  KeyframeSelection selection{SlamOptions{}};
  selection.set_last(T_start, SeenSpace(view_from(T_start)));
  const auto decide = [&](const Pose& T_start_now) {
    return selection.is_keyframe(T_start * T_start_now, view_from(T_start * T_start_now));
  };
  EXPECT_FALSE(decide(planar_pose(0.3, 0, 0.1)));
  EXPECT_TRUE(decide(planar_pose(1.6, 0, 0)));
  EXPECT_TRUE(decide(planar_pose(0, 0, to_radians(21.0))));
}

TEST(KeyframeSelection, WhatWasHiddenMakesAKeyframe) {
  const Pose T = SyntheticWorld::at(0, 0, 0);
  std::vector<Point> half = view_from(T);
  std::erase_if(half, [](const Point& p) { return p.x > 0.f; });
  KeyframeSelection selection{SlamOptions{}};
  selection.set_last(T, SeenSpace(half));
  EXPECT_FALSE(selection.is_keyframe(T, half));
  std::vector<Point> other = view_from(T);
  std::erase_if(other, [](const Point& p) { return p.x < 0.f; });
  EXPECT_TRUE(selection.is_keyframe(T, other)) << "from the same spot, but nothing of it was visible";
}

}  // namespace
}  // namespace revisit
