// SPDX-License-Identifier: Apache-2.0
#include <revisit/registration/elevation_offset.hpp>

#include <cmath>

#include <gtest/gtest.h>

#include "synthetic_world.hpp"

namespace revisit {
namespace {

using testing_support::SyntheticWorld;

// A drive whose sensor gives elevations that are too low by so much.
std::optional<ElevationOffset> learnt(double too_low_deg, int scans, double step_m = 2.5) {
  const SyntheticWorld world(31);
  ElevationLearner learner;
  for (int i = 0; i < scans; ++i) {
    const Pose T_world_lidar = SyntheticWorld::at(step_m * i, 0.0, 0.01 * i);
    std::vector<Point> points = world.scan(T_world_lidar, {64, 900, -24.8, 2.0}, static_cast<unsigned>(i)).points;
    for (Point& p : points) {
      const double across = std::hypot(p.x, p.y), elevation = std::atan2(p.z, across) - to_radians(too_low_deg);
      const double range = std::hypot(across, p.z), scale = range * std::cos(elevation) / across;
      p = {static_cast<float>(scale * p.x), static_cast<float>(scale * p.y),
           static_cast<float>(range * std::sin(elevation)), p.intensity};
    }
    learner.add(points, T_world_lidar);
  }
  return learner.solve();
}

TEST(ElevationLearner, FindsByHowMuchElevationsAreOff) {
  for (const double off_deg : {0.0, 0.3, -0.5}) {
    const auto found = learnt(off_deg, 12);
    ASSERT_TRUE(found);
    EXPECT_NEAR(found->offset_deg, off_deg, 0.05) << "deviation " << found->deviation_deg;
    EXPECT_LT(found->deviation_deg, 0.03);
    EXPECT_GE(found->pairs, 10U);
  }
}

TEST(ElevationLearner, SaysNothingOfFewScansOrOfASensorThatStandsStill) {
  EXPECT_FALSE(learnt(0.3, 3));
  EXPECT_FALSE(learnt(0.3, 8, 0.1));
}

}  // namespace
}  // namespace revisit
