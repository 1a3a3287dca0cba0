// SPDX-License-Identifier: Apache-2.0
#include <revisit/registration/overhead_search.hpp>

#include <cmath>

#include <gtest/gtest.h>

#include "synthetic_world.hpp"

namespace revisit {
namespace {

using testing_support::SyntheticWorld;

ThinCloud thin_scan(const SyntheticWorld& world, const Pose& T_world_lidar, unsigned seed) {
  const Scan scan = world.scan(T_world_lidar, {32, 900, -24.8, 5.0}, seed);
  std::vector<std::uint8_t> ground;
  for (const Point& p : scan.points) ground.push_back(p.z < -1.4f);
  return thin(scan.points, ground, 1.0);
}

TEST(OverheadSearch, FindsPositionAndHeading) {
  const SyntheticWorld world(31);
  const Pose T_a = SyntheticWorld::at(0, 0, 0);
  const ThinCloud a = thin_scan(world, T_a, 1);
  for (const auto& [x, y, yaw_deg] : {std::tuple{0.0, 0.0, 0.0}, {4.0, -3.0, 8.0}, {-5.0, 2.0, 175.0}}) {
    const Pose T_b = SyntheticWorld::at(x, y, to_radians(yaw_deg));
    const ThinCloud b = thin_scan(world, T_b, 2);
    OverheadSearch search(b);
    // From a heading 7 degrees off.
    const OverheadMatch found = search.search(a, to_radians(yaw_deg - 7.0), to_radians(9.0), 6).front();
    const Pose T_truth = T_a.inverse() * T_b;
    const Pose T_error = T_truth.inverse() * planar_pose(found.x_m, found.y_m, found.yaw_rad);
    EXPECT_LT(T_error.translation().head<2>().norm(), 1.5) << yaw_deg;
    EXPECT_LT(to_degrees(rotation_angle(T_error)), 3.1);
    EXPECT_GT(found.overlap, 0.6);
  }
}

// A sensor that looks ahead, laid on one that sees all round, and the other way: only what both see counts.
TEST(OverheadSearch, ANarrowViewOverlapsWithinItsSector) {
  const SyntheticWorld world(31);
  const Pose T_b = SyntheticWorld::at(2.0, -1.0, to_radians(20.0));
  const ThinCloud round = thin_scan(world, SyntheticWorld::at(0, 0, 0), 1);
  Scan ahead = world.scan(T_b, {32, 900, -24.8, 5.0}, 2);
  std::erase_if(ahead.points, [](const Point& p) { return !(p.x > 0.f && std::abs(p.y) < 0.7f * p.x); });
  std::vector<std::uint8_t> ground;
  for (const Point& p : ahead.points) ground.push_back(p.z < -1.4f);
  const ThinCloud narrow = thin(ahead.points, ground, 1.0);
  ASSERT_TRUE(round.seen.sector().is_all_round());
  const SeenSpace::Sector sector = narrow.seen.sector();
  ASSERT_FALSE(sector.is_all_round());
  EXPECT_TRUE(sector.holds({10.f, 6.f}));
  EXPECT_FALSE(sector.holds({10.f, 9.f}));
  EXPECT_FALSE(sector.holds({-10.f, 0.f}));
  for (const bool query_is_narrow : {true, false}) {
    OverheadSearch search(query_is_narrow ? narrow : round);
    const double yaw_rad = to_radians(query_is_narrow ? 20.0 : -20.0);
    const OverheadMatch found = search.search(query_is_narrow ? round : narrow, yaw_rad, to_radians(9.0), 6).front();
    EXPECT_NEAR(found.yaw_rad, yaw_rad, to_radians(6.0));
    EXPECT_GT(found.overlap, 0.6) << query_is_narrow;
  }
}

// Four walls: turned by half, a rectangle looks the same.
TEST(OverheadSearch, ARectangularRoomFitsBothWays) {
  std::vector<Point> room;
  for (float z = -1.f; z < 1.f; z += 0.5f) {
    for (float x = -14.f; x <= 14.f; x += 0.5f)
      for (const float y : {-8.f, 8.f}) room.push_back({x, y, z, 0.f});
    for (float y = -8.f; y <= 8.f; y += 0.5f)
      for (const float x : {-14.f, 14.f}) room.push_back({x, y, z, 0.f});
  }
  const ThinCloud cloud = thin(room, {}, 1.0);
  OverheadSearch search(cloud);
  const auto found = search.search(cloud, 0.0, kPi, 6.0, 2);
  ASSERT_EQ(found.size(), 2u);
  EXPECT_GT(found[1].overlap, 0.95);
  EXPECT_NEAR(std::abs(wrap_angle(found[0].yaw_rad - found[1].yaw_rad)), kPi, 0.06);
}

TEST(OverheadSearch, AnotherPlaceOverlapsLess) {
  const Pose T = SyntheticWorld::at(0, 0, 0);
  const ThinCloud a = thin_scan(SyntheticWorld(31), T, 1), other = thin_scan(SyntheticWorld(32), T, 2);
  OverheadSearch search(a);
  EXPECT_GT(search.search(a, 0.0, 0.1, 3).front().overlap, 0.99);
  EXPECT_LT(search.search(other, 0.0, to_radians(9.0), 6).front().overlap, 0.6);
}

TEST(OverheadSearch, OfNothingFindsNothing) {
  const ThinCloud nothing;
  const ThinCloud a = thin_scan(SyntheticWorld(31), SyntheticWorld::at(0, 0, 0), 1);
  OverheadSearch of_nothing(nothing), of_a(a);
  EXPECT_EQ(of_nothing.search(a, 0.0, 0.1, 3).front().overlap, 0.0);
  EXPECT_EQ(of_a.search(nothing, 0.3, 0.1, 3).front().overlap, 0.0);
  EXPECT_EQ(overhead_image(nothing, 1.0).count, 0u);
}

}  // namespace
}  // namespace revisit
