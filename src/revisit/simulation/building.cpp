// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include <revisit/core/pose.hpp>
#include <revisit/simulation/internal/world.hpp>

namespace revisit::simulation_internal {
namespace {

// The plan, metres: storeys that are all alike, laid side by side along y instead of one above the other. Each is a
// corridor around a core, rooms outside of it; a passage, the staircase, leads from one to the next.
constexpr double kRoomWidth_m = 4.0, kCorridor_m = 2.4, kRoom_m = 5.0, kWall_m = 0.2, kCeiling_m = 2.8, kDoor_m = 1.0;
constexpr int kBaysAlong = 10, kBaysAcross = 5;  // of the core
constexpr double kLong_m = kRoomWidth_m * kBaysAlong, kWide_m = kRoomWidth_m * kBaysAcross;
constexpr double kStorey_m = kWide_m + 2 * (kCorridor_m + kRoom_m) + 3.0;  // from one storey to the next
constexpr int kStoreys = 3;
constexpr float kAltered = 0.2f;  // of the bays, rebuilt since

class BuildingBuilder {
 public:
  explicit BuildingBuilder(World& world) : world_(world) {}

  void build() {
    for (int storey = 0; storey < kStoreys; ++storey) build_storey(storey);
    const double length = kLong_m + 2 * (kCorridor_m + kRoom_m) + 4.0, width = kStoreys * kStorey_m + 4.0;
    add_box(world_.solids, {0.5 * kLong_m, 0.5 * width - kRoom_m - 4.0, 0, 0}, length, width, kCeiling_m,
            kCeiling_m + 0.3, Material::kPlaster, 11);
    // The passage between storeys runs through a bay of rooms on either side.
    for (int storey = 0; storey + 1 < kStoreys; ++storey) {
      const double from = storey * kStorey_m + kWide_m + kCorridor_m, to = (storey + 1) * kStorey_m - kCorridor_m;
      for (const double x : {0.5 * kRoomWidth_m - 0.9, 0.5 * kRoomWidth_m + 0.9})
        add_box(world_.solids, {x, 0.5 * (from + to), 0, kPi / 2}, to - from, 0.1, 0.0, kCeiling_m, Material::kPlaster,
                12);
    }
  }

 private:
  // One side of a storey's corridor: `x, y` is the core's corner, `yaw` points along the wall, rooms lie to its right.
  void build_storey(int storey) {
    const double y = storey * kStorey_m;
    build_side({0, y, 0, 0}, kBaysAlong, storey, 0);
    build_side({kLong_m, y, 0, kPi / 2}, kBaysAcross, storey, 1);
    build_side({kLong_m, y + kWide_m, 0, kPi}, kBaysAlong, storey, 2);
    build_side({0, y + kWide_m, 0, -kPi / 2}, kBaysAcross, storey, 3);
  }

  // Along the side's x axis `along`, `right` of it: the core's wall is at 0, the rooms begin behind the corridor.
  static Stand at(const Stand& side, double along, double right, double turn_rad = 0.0) {
    const double c = std::cos(side.yaw_rad), s = std::sin(side.yaw_rad);
    return {side.x + along * c + right * s, side.y + along * s - right * c, 0, side.yaw_rad + turn_rad};
  }

  void build_side(const Stand& side, int bays, int storey, int number) {
    for (int bay = 0; bay < bays; ++bay) {
      const double middle = (bay + 0.5) * kRoomWidth_m;
      // What the architect drew is the same in all storeys, what people brought is not.
      const std::uint64_t everywhere = mix(world_.seed, std::uint64_t{100} * static_cast<std::uint64_t>(number) +
                                                            static_cast<std::uint64_t>(bay)),
                          brought = mix(everywhere, static_cast<std::uint64_t>(storey) + 1);
      const std::uint64_t drawn = uniform(mix(brought, 7)) < kAltered ? brought : everywhere;
      build_core(side, middle, drawn, brought);
      const bool is_passage =
          bay == (number == 0 ? 0 : bays - 1) && number % 2 == 0 && (number == 0 ? storey > 0 : storey + 1 < kStoreys);
      if (!is_passage) build_room(side, middle, drawn, brought);
    }
    // The corner: the outer walls go on to where they meet.
    const double length = kRoomWidth_m * bays, outer = kCorridor_m;
    for (const double end : {-0.5 * kCorridor_m, length + 0.5 * kCorridor_m})
      add_box(world_.solids, at(side, end, outer + 0.5 * kWall_m), kCorridor_m, kWall_m, 0.0, kCeiling_m,
              Material::kPlaster, 13);
  }

  void build_core(const Stand& side, double middle, std::uint64_t drawn, std::uint64_t brought) {
    Random random(drawn);
    if (random.chance(0.2)) {  // a colonnade before a glass wall
      for (const double x : {-1.3, 1.3})
        add_post(world_.solids, at(side, middle + x, -0.3), kCeiling_m, 0.2, Material::kConcrete, 14);
      add_box(world_.solids, at(side, middle, -1.6), kRoomWidth_m, 0.1, 0.0, kCeiling_m, Material::kGlass, drawn);
      return;
    }
    add_box(world_.solids, at(side, middle, -0.5 * kWall_m), kRoomWidth_m, kWall_m, 0.0, kCeiling_m, Material::kPlaster,
            15);
    add_box(world_.solids, at(side, middle, 0.02), kDoor_m, 0.04, 0.0, 2.1, Material::kDoor, drawn);
    Random things(brought);
    fit_out(side, middle, 0.0, 1.0, things);
  }

  // What hangs and stands along a wall: boards, posters and screens, radiators, lockers and benches, and what is moved
  // about. The wall's face is at `face`, the corridor `inwards` of it (+1 or -1).
  void fit_out(const Stand& side, double middle, double face, double inwards, Random& things) {
    for (int i = things.whole(0, 3); i > 0; --i) {
      const double along = middle + things.uniform(-1.7, 1.7), low = things.uniform(0.0, 1.2);
      const double deep = things.chance(0.6) ? things.uniform(0.03, 0.15) : things.uniform(0.2, 0.45);
      add_box(world_.solids, at(side, along, face + inwards * 0.5 * deep), things.uniform(0.3, 1.4), deep,
              deep > 0.2 ? 0.0 : low, things.uniform(1.3, 2.2) - (deep > 0.2 ? 0.6 : 0.0),
              things.chance(0.4)   ? Material::kPlastic
              : things.chance(0.5) ? Material::kWood
                                   : Material::kMetal,
              things.next());
    }
    if (things.chance(0.3)) add_slot(at(side, middle - 1.3, face + inwards * 0.4), things.next(), 0.7);
  }

  void build_room(const Stand& side, double middle, std::uint64_t drawn, std::uint64_t brought) {
    Random random(drawn), things(brought);
    const double wall = kCorridor_m + 0.5 * kWall_m, half = 0.5 * (kRoomWidth_m - kDoor_m),
                 door = random.uniform(-0.8, 0.8);
    for (const double sign : {-1.0, 1.0}) {
      const double length = half - sign * door;
      add_box(world_.solids, at(side, middle + door + sign * 0.5 * (kDoor_m + length), wall), length, kWall_m, 0.0,
              kCeiling_m, Material::kPlaster, 16);
    }
    add_box(world_.solids, at(side, middle + door, wall), kDoor_m, kWall_m, 2.1, kCeiling_m, Material::kPlaster, 16);
    fit_out(side, middle, kCorridor_m, -1.0, things);
    world_.movers.slots.push_back({at(side, middle + door, wall), things.next(), 0.55, 0.33, 0.0, 0.0,
                                   ParkingSlot::For::kDoor});  // closed, or open
    add_box(world_.solids, at(side, middle + 0.5 * kRoomWidth_m, wall + 0.5 * kRoom_m, kPi / 2), kRoom_m, 0.12, 0.0,
            kCeiling_m, Material::kPlaster, 17);
    const double back = kCorridor_m + kRoom_m;
    add_box(world_.solids, at(side, middle, back), kRoomWidth_m, kWall_m, 0.0, 0.9, Material::kPlaster, 18);
    add_box(world_.solids, at(side, middle, back), kRoomWidth_m, 0.04, 0.9, 2.3, Material::kGlass, 19);
    add_box(world_.solids, at(side, middle, back), kRoomWidth_m, kWall_m, 2.3, kCeiling_m, Material::kPlaster, 18);
    for (int i = things.whole(1, 4); i > 0; --i) {
      const Stand place = at(side, middle + things.uniform(-1.4, 1.4), kCorridor_m + things.uniform(1.2, kRoom_m - 0.8),
                             things.chance(0.5) ? kPi / 2 : 0.0);
      if (things.chance(0.3))
        add_slot(place, things.next(), 0.8);
      else  // a table or a cupboard
        add_box(world_.solids, place, 1.6, 0.7, 0.0, things.chance(0.6) ? 0.75 : 1.9, Material::kWood, things.next());
    }
  }

  // Something that is moved about.
  void add_slot(const Stand& place, std::uint64_t seed, double occupancy) {
    world_.movers.slots.push_back({place, seed, occupancy, 0.6 * std::max(0.0, 1.0 - world_.difficulty), 0.0,
                                   0.3 * world_.difficulty, ParkingSlot::For::kFurniture});
  }

  World& world_;
};

// Where the way breaks off to another side, the body follows: nobody turns faster, or all at once.
void turn_as_people_do(std::vector<Knot>& knots) {
  constexpr double kFastest_radps = 2.0, kEased_s = 0.4;
  constexpr double kMost_rad = kFastest_radps * Path::kStep_s;
  std::vector<double> headings_rad;  // without jumps
  for (const Knot& knot : knots) {
    const double before = headings_rad.empty() ? knot.yaw_rad : headings_rad.back();
    headings_rad.push_back(before + std::clamp(wrap_angle(knot.yaw_rad - before), -kMost_rad, kMost_rad));
  }
  constexpr auto kEased = static_cast<std::size_t>(kEased_s / Path::kStep_s);
  double sum = 0.0;
  for (std::size_t i = 0; i < knots.size(); ++i) {
    sum += headings_rad[i] - (i >= kEased ? headings_rad[i - kEased] : 0.0);
    knots[i].yaw_rad = wrap_angle(sum / static_cast<double>(std::min(i + 1, kEased)));
  }
}

// Around the core of each storey, some rounds one way, some the other; rooms are looked into from the corridor.
std::vector<Knot> walk(double length_m, Random& random) {
  const double out = 0.5 * kCorridor_m;
  const auto corner = [&](int storey, int i) {
    const double x[] = {-out, kLong_m + out, kLong_m + out, -out}, y[] = {-out, -out, kWide_m + out, kWide_m + out};
    return Eigen::Vector2d(x[i] + random.uniform(-0.3, 0.3), y[i] + storey * kStorey_m + random.uniform(-0.3, 0.3));
  };
  const auto length_of = [](const std::vector<Eigen::Vector2d>& corners) {
    double sum = 0.0;
    for (std::size_t i = 1; i < corners.size(); ++i) sum += (corners[i] - corners[i - 1]).norm();
    return sum;
  };
  std::vector<Eigen::Vector2d> corners = {{0.5 * kRoomWidth_m, -out}};
  int storey = 0, step = 1;
  bool is_at_first_corner = false;
  for (int round = 0; length_of(corners) < length_m; ++round) {
    const bool is_left = random.chance(0.6);
    if (!is_left && !is_at_first_corner) corners.push_back(corner(storey, 0));  // round the core, not through it
    for (int i = 0; i < 4; ++i) corners.push_back(corner(storey, is_left ? (i + 1) % 4 : 3 - i));
    if (!is_left) corners.push_back(corner(storey, 1));
    is_at_first_corner = is_left || round % 2 == 1;
    if (round % 2 == 0) continue;
    // Through the passage, which leaves from the far corridor upwards and from the near one downwards.
    if (storey + step < 0 || storey + step >= kStoreys) step = -step;
    const double passage = 0.5 * kRoomWidth_m, near = storey * kStorey_m - out, far = near + kWide_m + 2 * out;
    if (!is_left) corners.push_back(corner(storey, 0));
    if (step > 0) corners.push_back(corner(storey, 3));
    corners.emplace_back(passage, step > 0 ? far : near);
    storey += step;
    corners.emplace_back(passage, step > 0 ? storey * kStorey_m - out : storey * kStorey_m + kWide_m + out);
    if (step < 0) corners.push_back(corner(storey, 3));
    corners.push_back(corner(storey, 0));
  }
  std::vector<Knot> knots = drive(corners, {1.3, 0.6, 0.8, 0.7});
  turn_as_people_do(knots);
  return knots;
}

}  // namespace

Result<World> build_building(const SimulationOptions& options) {
  if (!options.trajectory.empty())
    return Error{options.trajectory + ": a building has its own walk; trajectories are for the town"};
  const auto seed = mix(static_cast<std::uint64_t>(options.seed), 4);
  Random random(seed);
  Path path(walk(options.length_m, random));
  Terrain terrain(path, kLong_m + 20.0, 0.0, 0);
  World world{std::move(path),   std::move(terrain),     {}, {}, {}, {}, seed, options.difficulty,
              {1.0, 0.15, 0.15}, Eigen::Vector3d::Zero()};  // carried before the chest
  BuildingBuilder(world).build();
  if (const Status status = choose_drive(world, options); !status) return status.error();
  if (world.day != 0) random = Random(world.seed_of_day());
  world.movers.note_visits(world.path, world.day, 12.0);
  const int people = static_cast<int>(std::lround(5.0 * options.traffic));
  for (int i = 0; i < people; ++i) {
    Mover mover;
    mover.way = Mover::Way::kToAndFro;
    mover.is_person = mover.steps_aside = true;
    mover.seed = random.next();
    mover.until_s = 1e9;
    mover.speed_mps = random.uniform(0.7, 1.5);
    mover.arc_m = random.uniform(0.0, 30.0);
    const double y = (i % kStoreys) * kStorey_m + (i % 2 == 0 ? -0.8 : kWide_m + 0.8), x = random.uniform(2.0, 18.0);
    mover.begin = {x, y, 0, 0};
    mover.end = {x + random.uniform(6.0, 20.0), y, 0, 0};
    world.movers.movers.push_back(mover);
  }
  return world;
}

}  // namespace revisit::simulation_internal
