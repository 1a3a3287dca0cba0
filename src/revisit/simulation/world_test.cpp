// SPDX-License-Identifier: Apache-2.0
#include <revisit/simulation/internal/world.hpp>

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include <revisit/core/pose.hpp>

namespace revisit::simulation_internal {
namespace {

World town(int seed) {
  SimulationOptions options;
  options.seed = seed;
  return *build_town(options, {});
}

bool stands_in(const Solid& s, double x, double y) {
  const float dx = static_cast<float>(x) - s.centre.x(), dy = static_cast<float>(y) - s.centre.y();
  return std::abs(s.cos_yaw * dx + s.sin_yaw * dy) < s.half.x() &&
         std::abs(s.cos_yaw * dy - s.sin_yaw * dx) < s.half.y();
}

// What reaches lower than a person's head.
bool is_in_the_way(const World& world, const Solid& s) {
  return static_cast<double>(s.centre.z() - s.half.z()) <
         world.terrain.height(static_cast<double>(s.centre.x()), static_cast<double>(s.centre.y())) + 1.8;
}

TEST(World, ParkedCarsLineTheStreetsAndMostChangeBetweenVisits) {
  for (const int seed : {1, 2, 3}) {
    const World world = town(seed);
    std::size_t beside = 0, revisited = 0, changed = 0, taken = 0;
    for (const ParkingSlot& slot : world.movers.slots) {
      double nearest_m = 1e9;
      for (const Knot& knot : world.path.knots())
        nearest_m = std::min(nearest_m, std::hypot(knot.x - slot.at.x, knot.y - slot.at.y));
      EXPECT_GT(nearest_m, 1.8) << "a car stands in the way";
      if (nearest_m > 12.0) continue;
      ++beside;
      taken += occupant(slot, 0.0).has_value();
      for (const float change_s : slot.changes_s) {
        ++revisited;
        const auto before = occupant(slot, static_cast<double>(change_s) - 0.1);
        const auto after = occupant(slot, static_cast<double>(change_s) + 0.1);
        changed += before != after;
      }
    }
    EXPECT_GT(beside, 40u) << "seed " << seed;
    EXPECT_GT(taken, beside / 3);
    EXPECT_GT(revisited, 30u) << "seed " << seed;
    EXPECT_GT(changed, revisited / 3);
    EXPECT_LT(changed, revisited) << "some stay";
  }
}

// Another day: the same town, driven the other way round and in part; other cars are parked in it.
TEST(World, AnotherDayIsAnotherDriveThroughTheSameWorld) {
  SimulationOptions options;
  const World world = *build_town(options, {});
  options.day = 2;
  options.from_m = 100.0;
  options.to_m = 300.0;
  options.reverse = true;
  options.beside_m = 1.5;
  const World other = *build_town(options, {});
  EXPECT_NEAR(other.path.length_m(), 200.0, 15.0) << "bends are shorter or longer beside";
  const Knot first = other.path.knots().front(), whole = world.path.beside(300.0, 1.5);
  EXPECT_LT(std::hypot(first.x - whole.x, first.y - whole.y), 1.5);
  EXPECT_NEAR(std::abs(wrap_angle(first.yaw_rad - whole.yaw_rad)), kPi, 0.05);

  ASSERT_EQ(world.solids.size(), other.solids.size());
  for (std::size_t i = 0; i < world.solids.size(); ++i)
    ASSERT_EQ(world.solids[i].centre, other.solids[i].centre) << "what stands there stays";
  ASSERT_EQ(world.movers.slots.size(), other.movers.slots.size());
  std::size_t changed = 0;
  for (std::size_t i = 0; i < world.movers.slots.size(); ++i)
    changed += occupant(world.movers.slots[i], 0.0) != occupant(other.movers.slots[i], 0.0);
  EXPECT_GT(changed, world.movers.slots.size() / 3);
  EXPECT_LT(changed, world.movers.slots.size()) << "some stay";

  options.from_m = 5000.0;
  options.to_m = 6000.0;
  const auto nothing = build_town(options, {});
  ASSERT_FALSE(nothing);
  EXPECT_NE(nothing.error().message.find("simulation.from_m = 5000"), std::string::npos) << nothing.error().message;
}

TEST(World, NobodyMovesThroughWallsOrThroughTheSensorsVehicle) {
  for (const int seed : {1, 2}) {
    const World world = town(seed);
    EXPECT_GT(world.movers.movers.size(), 15u);
    std::size_t people = 0;
    for (const Mover& mover : world.movers.movers) {
      people += mover.is_person;
      for (double time_s = std::max(0.0, mover.from_s); time_s < std::min(mover.until_s, world.path.duration_s());
           time_s += 0.4) {
        const auto at = place_of(mover, time_s, world.path);
        ASSERT_TRUE(at) << "it vanishes on the way";
        const Knot self = world.path.at(time_s);
        EXPECT_GT(std::hypot(at->x - self.x, at->y - self.y), mover.is_person ? 1.4 : 2.0);
        for (const Solid& solid : world.solids)
          if (stands_in(solid, at->x, at->y) && is_in_the_way(world, solid)) ADD_FAILURE() << "at " << time_s << " s";
      }
    }
    EXPECT_GT(people, 5u);
    EXPECT_LT(people, world.movers.movers.size());
  }
}

TEST(World, WhoDrivesAheadComesFromOutOfSightAndGoesThere) {
  Mover mover;
  mover.way = Mover::Way::kAhead;
  mover.from_s = 10.0;
  mover.until_s = 50.0;
  mover.arc_m = 20.0;
  std::vector<Knot> knots;
  for (int i = 0; i < 1000; ++i) knots.push_back({i * 1.0, 0.0, 0.0, 0.0});
  const Path path(std::move(knots));
  const auto gap_m = [&](double time_s) { return place_of(mover, time_s, path)->x - path.at(time_s).x; };
  EXPECT_GT(gap_m(10.0), Movers::kNear_m);
  EXPECT_NEAR(gap_m(30.0), 20.0, 1e-6);
  EXPECT_GT(gap_m(50.0), Movers::kNear_m);
  EXPECT_FALSE(place_of(mover, 9.9, path));
}

TEST(World, PeopleInTheWarehouseStepAside) {
  for (int seed = 1; seed <= 6; ++seed) {
    SimulationOptions options;
    options.world = "warehouse";
    options.seed = seed;
    const World world = *build_warehouse(options);
    for (double time_s = 0.0; time_s < world.path.duration_s(); time_s += 0.5) {
      const Knot self = world.path.at(time_s);
      for (const Mover& mover : world.movers.movers) {
        const auto at = place_of(mover, time_s, world.path);
        EXPECT_GE(std::hypot(at->x - self.x, at->y - self.y), 0.99);
        for (const Solid& solid : world.solids)
          if (stands_in(solid, at->x, at->y) && is_in_the_way(world, solid))
            ADD_FAILURE() << seed << ": at " << time_s << " s";
      }
    }
  }
}

TEST(World, ThroughABuildingNobodyWalksThroughWalls) {
  SimulationOptions options;
  options.world = "building";
  options.length_m = 250.0;
  for (options.seed = 1; options.seed <= 12; ++options.seed) {
    const World world = *build_building(options);
    std::size_t in_walls = 0;
    for (const Knot& knot : world.path.knots())
      in_walls += std::any_of(world.solids.begin(), world.solids.end(), [&](const Solid& each) {
        return stands_in(each, knot.x, knot.y) && is_in_the_way(world, each);
      });
    EXPECT_EQ(in_walls, 0u) << "seed " << options.seed;
  }
}

TEST(World, FeaturelessStretchesShowTheSameTreesAgain) {
  SimulationOptions options;
  options.length_m = 3000.0;
  const World world = *build_town(options, {});
  EXPECT_GE(world.featureless.size(), 3u);
  for (const Eigen::Vector2d& middle : world.featureless) {
    std::size_t crowns = 0, houses = 0;
    for (const Solid& solid : world.solids) {
      if ((solid.centre.head<2>().cast<double>() - middle).norm() > 35.0) continue;
      crowns += solid.shape == Shape::kCrown;
      houses += solid.facade != 0;
    }
    EXPECT_GT(crowns, 10u);
    EXPECT_EQ(houses, 0u);
  }
}

}  // namespace
}  // namespace revisit::simulation_internal
