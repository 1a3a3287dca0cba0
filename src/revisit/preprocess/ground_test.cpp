// SPDX-License-Identifier: Apache-2.0
#include <revisit/preprocess/ground.hpp>

#include <algorithm>
#include <numeric>
#include <random>

#include "shared_data.hpp"
#include "synthetic_world.hpp"

namespace revisit {
namespace {

using testing_support::SyntheticWorld;

struct Rates {
  double found, false_alarms;  // of the ground points; of the others
};

// In the synthetic world the ground is what lies at height 0.
Rates rates(const Scan& scan, const std::vector<std::uint8_t>& is_ground, double sensor_height_m) {
  double ground = 0, found = 0, other = 0, alarms = 0;
  for (std::size_t i = 0; i < scan.points.size(); ++i) {
    const double height = scan.points[i].z + sensor_height_m;
    if (height < 0.1) {
      ++ground;
      found += is_ground[i];
    } else if (height > 0.4) {
      ++other;
      alarms += is_ground[i];
    }
  }
  return {found / ground, alarms / other};
}

class GroundBySensor : public testing::TestWithParam<SyntheticWorld::Sensor> {};

TEST_P(GroundBySensor, FindsTheFloorAndSparesTheWalls) {
  const Scan scan = SyntheticWorld(7).scan(SyntheticWorld::at(0, 0, 0.4), GetParam());
  const auto result = segment_ground(scan, find_rings(scan), {});
  EXPECT_NE(result.rings, RingSource::kNone);
  const Rates r = rates(scan, result.is_ground, 1.73);
  EXPECT_GT(r.found, 0.9);
  EXPECT_LT(r.false_alarms, 0.05);
}

INSTANTIATE_TEST_SUITE_P(Sensors, GroundBySensor,
                         testing::Values(SyntheticWorld::Sensor{16, 1800, -15.0, 15.0},
                                         SyntheticWorld::Sensor{32, 1800, -30.67, 10.67},
                                         SyntheticWorld::Sensor{64, 1800, -24.8, 2.0}),
                         [](const auto& each) { return std::to_string(each.param.rings) + "_lines"; });

TEST(Ground, WithoutRingsThePolarGridDoes) {
  Scan scan = SyntheticWorld(7).scan(SyntheticWorld::at(0, 0, 0.4), {});
  const Rings none;
  const auto result = segment_ground(scan, none, {});
  EXPECT_EQ(result.rings, RingSource::kNone);
  const Rates r = rates(scan, result.is_ground, 1.73);
  EXPECT_GT(r.found, 0.9);
  EXPECT_LT(r.false_alarms, 0.1);
}

TEST(Ground, SmallFlatPatchesAreNotGround) {
  // A roof of 1 m x 1 m, 1.2 m above a floor that is seen all around.
  Scan scan = SyntheticWorld(7, 60.0, 0).scan(SyntheticWorld::at(0, 0, 0), {});
  const std::size_t floor_points = scan.points.size();
  for (int ring = 0; ring < 4; ++ring)
    for (int i = 0; i < 5; ++i) {
      scan.points.push_back({6.f + 0.25f * static_cast<float>(ring), 0.2f * static_cast<float>(i), -0.53f, 0.5f});
    }
  Rings rings = find_rings(Scan{scan.frame,
                                0.0,
                                {scan.points.begin(), scan.points.begin() + static_cast<std::ptrdiff_t>(floor_points)},
                                {},
                                {},
                                0,
                                0});
  for (int ring = 0; ring < 4; ++ring)
    for (int i = 0; i < 5; ++i) rings.of_point.push_back(static_cast<std::uint16_t>(40 + ring));
  const auto result = segment_ground(scan, rings, {});
  for (std::size_t i = floor_points; i < scan.points.size(); ++i) EXPECT_EQ(result.is_ground[i], 0);
}

TEST(Ground, EmptyAndSinglePointScans) {
  Scan scan;
  EXPECT_TRUE(segment_ground(scan, find_rings(scan), {}).is_ground.empty());
  scan.points.push_back({5.f, 0.f, -1.f, 0.f});
  EXPECT_EQ(segment_ground(scan, find_rings(scan), {}).is_ground.size(), 1u);
}

}  // namespace
}  // namespace revisit
