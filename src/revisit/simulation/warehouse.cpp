// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include <revisit/core/pose.hpp>
#include <revisit/simulation/internal/world.hpp>

namespace revisit::simulation_internal {
namespace {

// The plan, metres: aisles along y between racks, a cross aisle at either end, a yard with machines behind the far one.
constexpr double kAisle_m = 3.2, kRack_m = 2.4, kCross_m = 4.5, kRackLength_m = 32.4, kYard_m = 12.0, kHeight_m = 9.0;
constexpr double kBay_m = 2.7, kLevel_m = 1.6;

struct Plan {
  int aisles = 6;
  double width() const { return aisles * kAisle_m + (aisles + 1) * kRack_m; }
  double length() const { return 2 * kCross_m + kRackLength_m + kYard_m; }
  double aisle_x(int aisle) const { return (aisle + 1) * kRack_m + (aisle + 0.5) * kAisle_m; }
  double south_y() const { return 0.5 * kCross_m; }
  double north_y() const { return 1.5 * kCross_m + kRackLength_m; }
};

void add_rack(Solids& out, double x, std::uint64_t seed) {
  Random random(seed);
  const int bays = static_cast<int>(kRackLength_m / kBay_m);
  for (int bay = 0; bay <= bays; ++bay)
    for (const double side : {-1.05, -0.1, 0.1, 1.05})
      add_box(out, {x + side, kCross_m + kBay_m * bay, 0, 0}, 0.09, 0.11, 0.0, 4 * kLevel_m + 0.4, Material::kMetal,
              77);
  for (int level = 1; level <= 4; ++level)
    for (const double side : {-1.05, 1.05})
      add_box(out, {x + side, kCross_m + 0.5 * kRackLength_m, 0, 0}, 0.05, kRackLength_m, level * kLevel_m - 0.12,
              level * kLevel_m, Material::kMetal, 78);
  // Most loads are alike; some places are empty, some loads are of another kind.
  for (int bay = 0; bay < bays; ++bay)
    for (int level = 0; level <= 4; ++level)
      for (const double side : {-0.58, 0.58})
        for (const double place : {0.7, 2.0}) {
          const double dice = random.uniform();
          if (dice < 0.22) continue;
          const double height = dice < 0.75 ? 1.2 : random.uniform(0.4, 1.35),
                       depth = dice < 0.75 ? 0.8 : random.uniform(0.6, 0.95);
          const Stand at{x + side + random.uniform(-0.04, 0.04),
                         kCross_m + kBay_m * bay + place + random.uniform(-0.05, 0.05), 0, random.uniform(-0.03, 0.03)};
          add_box(out, at, depth, 1.1, level * kLevel_m, level * kLevel_m + 0.14, Material::kWood, random.next());
          add_box(out, at, depth, 1.05, level * kLevel_m + 0.14, level * kLevel_m + 0.1 + height,
                  random.chance(0.8) ? Material::kCardboard : Material::kPlastic, random.next());
        }
}

void add_hall(Solids& out, const Plan& plan, std::uint64_t seed) {
  Random random(seed);
  const double w = plan.width(), l = plan.length();
  const auto wall = [&](double x, double y, double length, double width) {
    add_box(out, {x, y, 0, 0}, length, width, -0.5, kHeight_m, Material::kConcrete, 91);
  };
  wall(0.5 * w, -0.15, w + 0.6, 0.3);
  wall(0.5 * w, l + 0.15, w + 0.6, 0.3);
  wall(-0.15, 0.5 * l, 0.3, l);
  wall(w + 0.15, 0.5 * l, 0.3, l);
  add_box(out, {0.5 * w, 0.5 * l, 0, 0}, w, l, kHeight_m, kHeight_m + 0.3, Material::kMetal, 92);
  for (double y = 6.0; y < l; y += 6.0)
    add_box(out, {0.5 * w, y, 0, 0}, w, 0.25, kHeight_m - 0.6, kHeight_m, Material::kMetal, 93);
  for (double x = 4.0; x + 3.0 < w; x += random.uniform(7.0, 12.0)) {  // gates and doors in the ends
    add_box(out, {x, 0.02, 0, 0}, random.uniform(1.0, 3.6), 0.1, 0.0, random.uniform(2.1, 3.6), Material::kDoor,
            random.next());
    add_box(out, {x + 2.0, l - 0.02, 0, 0}, random.uniform(1.0, 3.6), 0.1, 0.0, random.uniform(2.1, 3.6),
            Material::kDoor, random.next());
  }
  for (int i = 0; i < plan.aisles; ++i)  // a reflector at the end of each rack
    add_box(out, {plan.aisle_x(i) - 0.5 * kAisle_m - 0.05, kCross_m - 0.08, 0, 0}, 0.1, 0.02, 1.0, 1.4,
            Material::kRetro, 94);
}

void add_machines(Solids& out, const Plan& plan, std::uint64_t seed) {
  Random random(seed);
  const double first = plan.north_y() + 0.5 * kCross_m + 1.5;
  for (double x = 3.0; x + 3.0 < plan.width(); x += random.uniform(4.0, 6.5)) {
    const Stand at{x, first + random.uniform(2.6, kYard_m - 4.0), 0, random.uniform(0.0, kPi)};
    add_box(out, at, random.uniform(1.2, 3.0), random.uniform(1.0, 2.2), 0.0, random.uniform(1.0, 2.6),
            Material::kPaint, random.next());
    add_box(out, at, 0.6, 0.5, 0.0, random.uniform(1.6, 3.2), Material::kMetal, random.next());
    Stand beside = at;
    beside.x += random.uniform(1.2, 1.8);
    add_post(out, beside, random.uniform(1.0, 4.5), random.uniform(0.1, 0.5), Material::kMetal, random.next());
  }
}

// Out through the aisles and back again, with a turn on the spot in between and at the dock.
std::vector<Knot> robot_drive(const Plan& plan, double length_m, Random& random) {
  std::vector<Eigen::Vector2d> out = {{1.6, plan.south_y()}};
  double driven_m = 0.0;
  bool at_south = true;
  for (int aisle = 0; driven_m < 0.5 * length_m; aisle = (aisle + random.whole(1, 2)) % plan.aisles) {
    const double near_y = at_south ? plan.south_y() : plan.north_y(),
                 far_y = at_south ? plan.north_y() : plan.south_y();
    for (const double y : {near_y, far_y}) {
      const Eigen::Vector2d next(plan.aisle_x(aisle) + random.uniform(-0.3, 0.3), y + random.uniform(-0.4, 0.4));
      driven_m += (next - out.back()).norm();
      out.push_back(next);
    }
    at_south = !at_south;
  }
  const Driving slow{1.2, 0.6, 0.5, 1.2};
  std::vector<Knot> knots = drive(out, slow);
  const auto turn = [&knots] {
    const Knot last = knots.back();
    for (int i = 1; i <= 60; ++i) knots.push_back({last.x, last.y, wrap_angle(last.yaw_rad + kPi * i / 60.0), 0.0});
  };
  turn();
  std::vector<Eigen::Vector2d> back(out.rbegin(), out.rend());
  back.front() = {knots.back().x, knots.back().y};
  for (std::size_t i = 1; i + 1 < back.size(); ++i)
    back[i] += Eigen::Vector2d(random.uniform(-0.15, 0.15), random.uniform(-0.15, 0.15));
  const std::vector<Knot> home = drive(back, slow);
  knots.insert(knots.end(), home.begin() + 1, home.end());
  return knots;
}

}  // namespace

Result<World> build_warehouse(const SimulationOptions& options) {
  if (!options.trajectory.empty())
    return Error{options.trajectory + ": a warehouse has its own drive; trajectories are for the town"};
  const auto seed = mix(static_cast<std::uint64_t>(options.seed), 2);
  Random random(seed);
  const Plan plan{random.whole(6, 8)};
  Path path(robot_drive(plan, options.length_m, random));
  Terrain terrain(path, plan.length() + 10.0, 0.0, 0);
  World world{std::move(path),  std::move(terrain),     {}, {}, {}, {}, seed, options.difficulty,
              {0.8, 0.35, 0.3}, Eigen::Vector3d::Zero()};
  add_hall(world.solids, plan, mix(seed, 3));
  for (int rack = 0; rack <= plan.aisles; ++rack)
    add_rack(world.solids, rack * (kRack_m + kAisle_m) + 0.5 * kRack_m, mix(seed, 4, static_cast<std::uint64_t>(rack)));
  add_machines(world.solids, plan, mix(seed, 5));
  add_box(world.solids, {0.5, plan.south_y(), 0, 0}, 0.6, 0.8, 0.0, 0.9, Material::kPlastic, 95);  // the dock

  if (const Status status = choose_drive(world, options); !status) return status.error();
  if (world.day != 0) random = Random(world.seed_of_day());

  // People along the cross aisles, and a fork lift in the yard; who meets the robot steps aside.
  const int people = static_cast<int>(std::lround(6.0 * options.traffic));
  for (int i = 0; i < people; ++i) {
    Mover mover;
    mover.way = Mover::Way::kToAndFro;
    mover.is_person = i % 4 != 3;
    mover.vehicle = VehicleKind::kForklift;
    mover.seed = random.next();
    mover.steps_aside = true;
    mover.until_s = 1e9;
    mover.speed_mps = mover.is_person ? random.uniform(0.7, 1.5) : 1.8;
    mover.arc_m = random.uniform(0.0, 30.0);
    const double y =
        !mover.is_person ? plan.north_y() + 3.5 : (i % 2 == 0 ? plan.south_y() + 1.2 : plan.north_y() + 1.2);
    const double x = random.uniform(3.0, 0.5 * plan.width());
    mover.begin = {x, y, 0, 0};
    mover.end = {x + random.uniform(4.0, 0.5 * plan.width() - 3.0), y, 0, 0};
    world.movers.movers.push_back(mover);
  }
  return world;
}

}  // namespace revisit::simulation_internal
