// SPDX-License-Identifier: Apache-2.0
#include <revisit/pipeline/narrow_view.hpp>

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "synthetic_world.hpp"

namespace revisit {
namespace {

using testing_support::SyntheticWorld;

// A sensor of so wide a view, turned by so much.
PreparedScan turned_scan(double yaw_rad, double view_deg) {
  Scan scan = SyntheticWorld(41).scan(SyntheticWorld::at(0, 0, yaw_rad), {32, 900, -24.8, 5.0});
  std::erase_if(scan.points,
                [&](const Point& p) { return std::abs(std::atan2(p.y, p.x)) > to_radians(view_deg) / 2.0; });
  PreparedScan prepared = *prepare_scan(std::move(scan), {}, {});
  prepared.trajectory_point.emplace();
  prepared.trajectory_point->T_segment_lidar = planar_pose(0.0, 0.0, yaw_rad);
  prepared.geometry = std::make_shared<ScanGeometry>(prepared.cloud);
  return prepared;
}

TEST(NarrowView, IsWidenedByWhatWasSeenBeforeTheSensorTurned) {
  NarrowView view;
  PreparedScan first = turned_scan(0.0, 70.0), second = turned_scan(to_radians(50.0), 70.0);
  view.widen(first);
  EXPECT_FALSE(first.cloud.before) << "nothing was";
  view.widen(second);
  ASSERT_TRUE(second.cloud.before);
  for (const Eigen::Vector3f& p : second.cloud.before->points)
    EXPECT_LT(std::atan2(p.y(), p.x()), to_radians(-10.0)) << "to the right; the rest it sees itself";
  EXPECT_NEAR(second.geometry->surface().view().sector.width_rad, to_radians(70.0), 0.1);
  EXPECT_NEAR(second.geometry->widened().view().sector.width_rad, to_radians(120.0), 0.1);
  EXPECT_EQ(second.geometry->widened().size(), second.cloud.points.size() + second.cloud.before->points.size());
}

TEST(NarrowView, OfWhatSeesMoreIsLeftAsItIs) {
  NarrowView view;
  PreparedScan first = turned_scan(0.0, 200.0), second = turned_scan(to_radians(50.0), 200.0);
  view.widen(first);
  view.widen(second);
  EXPECT_FALSE(second.cloud.before);
  EXPECT_FALSE(second.geometry->is_widened());
  EXPECT_EQ(&second.geometry->widened(), &second.geometry->surface());
}

}  // namespace
}  // namespace revisit
