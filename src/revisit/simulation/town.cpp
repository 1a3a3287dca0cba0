// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <optional>

#include <revisit/core/pose.hpp>
#include <revisit/simulation/internal/footprints.hpp>
#include <revisit/simulation/internal/world.hpp>

namespace revisit::simulation_internal {
namespace {

constexpr double kBuilt_m = 130.0;  // what lies farther from the drive is not built

// Fills one side of a lane after the other, walking along it.
class TownBuilder {
 public:
  TownBuilder(World& world) : world_(world) {
    // What is driven on stays free; cars may be parked beside it.
    constexpr double kRight_m = -1.3, kLeft_m = 3.4;
    for (const LanePoint& p : world.roads.points())
      taken_.take(rectangle(p, 0.5 * (kLeft_m + kRight_m), 0.5 * (kLeft_m - kRight_m), 0.8));
  }

  void build() {
    const std::vector<LanePoint>& lane = world_.roads.points();
    for (const int layer : {0, 1, 2})  // first what stands at the kerb, then the houses, then what lies behind them
      for (const int side : {-1, 1}) {
        double next_m[8] = {};
        for (std::size_t i = 0; i < lane.size(); ++i) {
          if (i > 0 && std::abs(lane[i].arc_m - lane[i - 1].arc_m) > 3.0)
            std::fill(std::begin(next_m), std::end(next_m), 0.0);
          if (layer == 0) kerb(lane[i], side, next_m);
          if (layer == 1) front(lane[i], side, next_m);
          if (layer == 2) behind(lane[i], side, next_m);
        }
      }
  }

 private:
  static double edge(int side) { return static_cast<double>(side > 0 ? Roads::kLeftEdge_m : Roads::kRightEdge_m); }

  // A rectangle beside the lane: its middle `left_m` to the left, half across, half along.
  static Footprints::Rectangle rectangle(const LanePoint& p, double left_m, double half_across_m, double half_along_m,
                                         double along_m = 0.0) {
    const double c = static_cast<double>(p.cos_yaw), s = static_cast<double>(p.sin_yaw);
    return {static_cast<double>(p.x) + along_m * c - left_m * s, static_cast<double>(p.y) + along_m * s + left_m * c,
            std::atan2(s, c), half_along_m, half_across_m};
  }
  // Where a thing stands on it; its front (-y) faces the lane.
  Stand stand(const Footprints::Rectangle& r, int side) const {
    return {r.x, r.y, world_.stand_z(r.x, r.y), r.yaw_rad + (side > 0 ? 0.0 : kPi)};
  }
  // One random stream a place, so that the town does not depend on how it is walked through.
  Random random_at(const LanePoint& p, int what) const {
    return Random(mix(world_.seed,
                      as_key(floor_int(p.x * 2.f) + 100000) * 400009 + as_key(floor_int(p.y * 2.f) + 100000),
                      static_cast<std::uint64_t>(what)));
  }
  // Takes the ground for a thing, but none of a stretch without features.
  bool claim(const Footprints::Rectangle& r) {
    return district_at(world_, r.x, r.y) != District::kFeatureless && taken_.take_if_free(r);
  }
  bool is_due(const LanePoint& p, double& next_m) const { return static_cast<double>(p.arc_m) >= next_m; }

  // Kerb side: parked cars on the edge of the road, trees, lamps and signs on the pavement.
  void kerb(const LanePoint& p, int side, double* next_m) {
    const District district = district_at(world_, static_cast<double>(p.x), static_cast<double>(p.y));
    Random random = random_at(p, side);
    const double arc_m = static_cast<double>(p.arc_m);
    if (district == District::kFeatureless) {
      featureless(p, side, next_m);
      return;
    }
    if (is_due(p, next_m[0])) {
      next_m[0] = arc_m + 6.3;
      const auto r = rectangle(p, edge(side) - side * 1.0, 0.95, 2.6);
      const bool has_slots = district == District::kPark ? random.chance(0.15) : random.chance(0.85);
      if (has_slots && claim(r)) {
        Stand at = stand(r, side);
        at.x += random.uniform(-0.15, 0.15);
        at.yaw_rad += random.uniform(-0.03, 0.03) + (random.chance(0.1) ? kPi : 0.0);
        world_.movers.slots.push_back({at, random.next(), random.uniform(0.4, 0.95), stays(),
                                       1.0 / 9.0 + 0.15 * world_.difficulty, 0.5 * world_.difficulty});
      }
    }
    if (world_.difficulty > 0.0 && is_due(p, next_m[5])) clutter(p, side, next_m[5], random);
    if (is_due(p, next_m[1])) {
      const auto r = rectangle(p, edge(side) + side * 0.4, 0.25, 0.25);
      next_m[1] = arc_m + random.uniform(24.0, 33.0);
      if (claim(r)) add_lamp(world_.solids, stand(r, side), random.next());
    }
    if (is_due(p, next_m[2])) {
      next_m[2] = arc_m + random.uniform(12.0, 60.0);
      const auto r = rectangle(p, edge(side) + side * random.uniform(0.5, 1.2), 0.3, 0.3);
      if (claim(r)) {
        Stand at = stand(r, side);
        at.yaw_rad += kPi / 2 + random.uniform(-0.2, 0.2);
        if (random.chance(0.5))
          add_sign(world_.solids, at, random.next());
        else
          add_post(world_.solids, at, random.uniform(0.8, 1.2), random.uniform(0.05, 0.4),
                   random.chance(0.5) ? Material::kPlastic : Material::kMetal, random.next());
      }
    }
    if (is_due(p, next_m[3])) {
      next_m[3] = arc_m + (district == District::kCommercial ? 11.0 : random.uniform(8.0, 30.0));
      const auto r = rectangle(p, edge(side) + side * 1.3, 0.4, 0.4);
      if (random.chance(0.6) && claim(r))
        add_tree(world_.solids, stand(r, side), random.uniform(4.5, 9.0), random.next());
    }
  }

  // Of what stands beside the road, how much is still there at the next visit.
  double stays() const { return 0.33 * std::max(0.0, 1.0 - world_.difficulty); }

  // What is put down for some days, on the pavement or in a front garden.
  void clutter(const LanePoint& p, int side, double& next_m, Random& random) {
    next_m = static_cast<double>(p.arc_m) + random.uniform(4.0, 16.0) / world_.difficulty;
    const auto r = rectangle(p, edge(side) + side * random.uniform(0.6, 3.5), 0.5, 1.2);
    if (!claim(r)) return;
    world_.movers.slots.push_back({stand(r, side), random.next(), random.uniform(0.2, 0.8), 0.5 * stays(), 0.0,
                                   0.5 * world_.difficulty, ParkingSlot::For::kClutter});
  }

  // The same tree every seven metres on both sides and nothing else: what one such stretch shows, all others do.
  void featureless(const LanePoint& p, int side, double* next_m) {
    if (!is_due(p, next_m[4])) return;
    next_m[4] = (std::floor(static_cast<double>(p.arc_m) / 7.0) + 1.0) * 7.0;
    for (const double away_m : {2.2, 9.2}) {
      const auto r = rectangle(p, edge(side) + side * away_m, 0.4, 0.4);
      if (taken_.take_if_free(r)) add_tree(world_.solids, stand(r, side), 9.0, 4711);
    }
  }

  void front(const LanePoint& p, int side, double* next_m) {
    if (!is_due(p, next_m[0])) return;
    Random random = random_at(p, 10 + side);
    switch (district_at(world_, static_cast<double>(p.x), static_cast<double>(p.y))) {
      case District::kRows:
        if (const auto row = row_of_twins(p, side)) random = Random(*row);
        return row_house(p, side, random, next_m[0]);
      case District::kDetached:
        return detached_house(p, side, random, next_m[0]);
      case District::kCommercial:
        return hall(p, side, random, next_m[0]);
      case District::kPark:
        return park(p, side, random, next_m[0]);
      case District::kFeatureless:
        return;
    }
  }

  static Material walls(Random& random) {
    return random.chance(0.6) ? Material::kPlaster : random.chance(0.6) ? Material::kBrick : Material::kConcrete;
  }

  // Streets of houses that are all alike: every one starts from the seed of its row.
  std::optional<std::uint64_t> row_of_twins(const LanePoint& p, int side) const {
    constexpr float kRow_m = 60.f;
    const std::uint64_t row = mix(mix(world_.seed, 22, side > 0), as_key(floor_int(p.x / kRow_m) + 10000),
                                  as_key(floor_int(p.y / kRow_m) + 10000));
    if (static_cast<double>(uniform(row)) >= 0.3 * world_.difficulty) return std::nullopt;
    return mix(world_.seed, 23, row);
  }

  void row_house(const LanePoint& p, int side, Random& random, double& next_m) {
    const double width = random.uniform(6.5, 12.0), depth = random.uniform(9.0, 13.0),
                 setback = random.uniform(1.7, 2.6);
    const auto r =
        rectangle(p, edge(side) + side * (setback + 0.5 * depth), 0.5 * depth - 0.3, 0.5 * width - 0.3, 0.5 * width);
    if (!claim(r)) return;
    const bool gap = random.chance(0.22);
    next_m = static_cast<double>(p.arc_m) + width + (gap ? random.uniform(3.0, 9.0) : 0.05);
    add_house(world_.solids, stand(r, side),
              {width, depth, 3.0 * random.whole(2, 4) + 0.4, random.chance(0.7) ? random.uniform(2.5, 4.5) : 0.0,
               random.whole(1, 3), walls(random)},
              random.next());
    if (gap)
      barrier(p, side, edge(side) + side * (setback + 0.4), width + 0.2, next_m - static_cast<double>(p.arc_m), random);
  }

  void detached_house(const LanePoint& p, int side, Random& random, double& next_m) {
    const double width = random.uniform(8.0, 14.0), depth = random.uniform(8.0, 12.0),
                 setback = random.uniform(4.5, 9.0);
    const double plot = width + random.uniform(5.0, 14.0);
    const auto r = rectangle(p, edge(side) + side * (setback + 0.5 * depth), 0.5 * depth, 0.5 * width, 0.5 * plot);
    if (!claim(r)) return;
    next_m = static_cast<double>(p.arc_m) + plot;
    Stand at = stand(r, side);
    at.yaw_rad += random.uniform(-0.06, 0.06) + (random.chance(0.3) ? kPi / 2 : 0.0);
    add_house(world_.solids, at,
              {std::min(width, depth), std::min(width, depth), random.uniform(2.9, 6.2), random.uniform(2.5, 4.5),
               random.whole(1, 3), walls(random)},
              random.next());
    barrier(p, side, edge(side) + side * 1.9, 0.0, plot - 3.0, random);
    for (int i = random.whole(0, 3); i > 0; --i) {
      const auto garden =
          rectangle(p, edge(side) + side * random.uniform(3.2, 7.0), 0.5, 0.5, random.uniform(0.0, plot));
      if (!claim(garden)) continue;
      if (random.chance(0.5))
        add_bush(world_.solids, stand(garden, side), random.uniform(1.0, 2.5), random.next());
      else
        add_tree(world_.solids, stand(garden, side), random.uniform(3.0, 7.0), random.next());
    }
  }

  // A fence, hedge or wall beside the lane, in pieces that follow the ground.
  void barrier(const LanePoint& p, int side, double left_m, double from_m, double to_m, Random& random) {
    const int kind = random.whole(0, 4);
    const double height = random.uniform(0.8, 1.9);
    const std::uint64_t seed = random.next();
    constexpr double kPiece_m = 3.0;
    for (double at_m = from_m; at_m + kPiece_m <= to_m && kind < 4; at_m += kPiece_m) {
      const auto r = rectangle(p, left_m, 0.2, 0.45 * kPiece_m, at_m + 0.5 * kPiece_m);
      if (!claim(r)) continue;
      const Stand at = stand(r, side);
      if (kind == 0) add_fence(world_.solids, at, kPiece_m, height, seed);
      if (kind == 1 || kind == 3)
        add_hedge(world_.solids, at, kPiece_m, height, mix(seed, static_cast<std::uint64_t>(at_m)));
      if (kind == 2) add_box(world_.solids, at, kPiece_m, 0.24, -1.0, height, Material::kConcrete, seed);
    }
  }

  void hall(const LanePoint& p, int side, Random& random, double& next_m) {
    const double width = random.uniform(18.0, 45.0), depth = random.uniform(14.0, 30.0),
                 setback = random.uniform(3.0, 12.0);
    const auto r = rectangle(p, edge(side) + side * (setback + 0.5 * depth), 0.5 * depth, 0.5 * width, 0.5 * width);
    if (!claim(r)) {
      next_m = static_cast<double>(p.arc_m) + 4.0;
      return;
    }
    next_m = static_cast<double>(p.arc_m) + width + random.uniform(4.0, 14.0);
    add_house(world_.solids, stand(r, side),
              {width, depth, random.uniform(6.0, 20.0), 0.0, random.whole(4, 6),
               random.chance(0.5) ? Material::kConcrete : Material::kMetal},
              random.next());
  }

  void park(const LanePoint& p, int side, Random& random, double& next_m) {
    next_m = static_cast<double>(p.arc_m) + random.uniform(2.0, 6.0);
    const auto r = rectangle(p, edge(side) + side * random.uniform(2.5, 28.0), 0.5, 0.5);
    if (!claim(r)) return;
    const double kind = random.uniform();
    if (kind < 0.45)
      add_tree(world_.solids, stand(r, side), random.uniform(4.0, 13.0), random.next());
    else if (kind < 0.6)
      add_conifer(world_.solids, stand(r, side), random.uniform(5.0, 14.0), random.next());
    else
      add_bush(world_.solids, stand(r, side), random.uniform(0.7, 3.0), random.next());
  }

  // Back yards and what is seen between the houses: more houses and trees.
  void behind(const LanePoint& p, int side, double* next_m) {
    if (!is_due(p, next_m[0])) return;
    Random random = random_at(p, 20 + side);
    next_m[0] = static_cast<double>(p.arc_m) + random.uniform(5.0, 14.0);
    if (district_at(world_, static_cast<double>(p.x), static_cast<double>(p.y)) == District::kFeatureless) return;
    const double left_m = edge(side) + side * random.uniform(16.0, 55.0), size = random.uniform(8.0, 16.0);
    if (random.chance(0.4)) {
      const auto r = rectangle(p, left_m, 0.5 * size, 0.5 * size);
      if (claim(r))
        add_house(world_.solids, stand(r, side),
                  {size, size, random.uniform(4.0, 12.0), random.uniform(0.0, 4.0), random.whole(1, 3), walls(random)},
                  random.next());
      return;
    }
    const auto r = rectangle(p, left_m, 0.6, 0.6);
    if (!claim(r)) return;
    if (random.chance(0.25))
      add_conifer(world_.solids, stand(r, side), random.uniform(6.0, 14.0), random.next());
    else
      add_tree(world_.solids, stand(r, side), random.uniform(5.0, 12.0), random.next());
  }

  World& world_;
  Footprints taken_;
};

}  // namespace

District district_at(const World& world, double x, double y) {
  constexpr double kStretch_m = 55.0;
  for (const Eigen::Vector2d& middle : world.featureless)
    if ((Eigen::Vector2d(x, y) - middle).squaredNorm() < kStretch_m * kStretch_m) return District::kFeatureless;
  constexpr double kBlock_m = 115.0;
  const auto block =
      mix(mix(world.seed, 21), as_key(floor_int(x / kBlock_m) + 10000), as_key(floor_int(y / kBlock_m) + 10000));
  const float dice = uniform(block);
  return dice < 0.38f   ? District::kRows
         : dice < 0.72f ? District::kDetached
         : dice < 0.87f ? District::kCommercial
                        : District::kPark;
}

Ground World::ground_at(float x, float y) const {
  if (roads.points().empty()) return {};
  constexpr float kKerb_m = 0.11f;
  const auto place = roads.nearest(x, y);
  const float left = place ? place->left_m : 1e3f;
  const float outside = left > 0.f ? left - Roads::kLeftEdge_m : Roads::kRightEdge_m - left;
  if (outside > Roads::kPavement_m) {
    const District district = district_at(*this, static_cast<double>(x), static_cast<double>(y));
    if (district == District::kCommercial) return {Material::kPavement, kKerb_m};
    // Patches of earth in the grass.
    const bool is_earth =
        smooth_noise(mix(seed, 41), static_cast<double>(x) / 6.0, static_cast<double>(y) / 6.0) > 0.35;
    return {is_earth ? Material::kEarth : Material::kGrass, district == District::kFeatureless ? 0.f : kKerb_m};
  }
  if (outside > 0.f) {
    const District district = district_at(*this, static_cast<double>(x), static_cast<double>(y));
    if (district == District::kFeatureless) return {Material::kEarth, 0.f};
    return {Material::kPavement, kKerb_m};
  }
  const float dash = place->arc_m / 9.f;
  const bool on_dash = dash - static_cast<float>(floor_int(dash)) < 0.4f;
  const bool is_marking = (std::abs(left - Roads::kCentreLine_m) < 0.07f && on_dash) ||
                          std::abs(left - Roads::kRightEdge_m - 2.0f) < 0.06f ||
                          std::abs(left - Roads::kLeftEdge_m + 2.0f) < 0.06f;
  return {is_marking ? Material::kMarking : Material::kAsphalt, 0.f};
}

namespace {

// Leaves let beams through, and fall and grow again between visits; some trees are evergreen.
void let_foliage_change(World& world) {
  for (Solid& solid : world.solids) {
    if (solid.shape != Shape::kCrown && solid.shape != Shape::kHedge) continue;
    const float dice = uniform(mix(world.seed, 24, solid.object));
    const double bare = std::min(1.0, world.difficulty) * static_cast<double>(dice);
    solid.filled = static_cast<std::uint8_t>(64.0 * (1.0 - 0.75 * bare));
    const double change = std::min(0.95, world.difficulty * (dice < 0.25f ? 0.25 : 0.8));
    solid.changing = static_cast<std::uint8_t>(256.0 * change);
  }
}

}  // namespace

Status populate_town(World& world, const SimulationOptions& options) {
  TownBuilder(world).build();
  let_foliage_change(world);
  if (Status status = choose_drive(world, options); !status) return status;
  world.movers.note_visits(world.path, world.day);
  plan_traffic(world, options.traffic);
  return ok();
}

Result<World> build_town(const SimulationOptions& options, const LogSink& log) {
  const auto seed = mix(static_cast<std::uint64_t>(options.seed), 1);
  StreetDrive drive;
  constexpr double hills_m = 7.0;
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  if (options.trajectory.empty()) {
    drive = drive_through_streets(options.length_m, seed);
  } else {
    auto path = read_path(options.trajectory, log);
    if (!path) return path.error();
    const Knot& first = path->knots().front();
    origin = {first.x, first.y, first.ground_z};
    drive.path = path->moved(-origin);
  }
  Terrain terrain(drive.path, kBuilt_m, hills_m, mix(seed, 2));
  drive.streets.insert(drive.streets.begin(), drive.path.knots());
  Roads roads(drive.streets, terrain);
  World world{
      std::move(drive.path), std::move(terrain), std::move(roads), {}, {}, {}, seed, options.difficulty, {}, origin};
  Random random(mix(seed, 3));
  for (double arc_m = 0.25 * std::min(world.path.length_m(), 1000.0); arc_m < world.path.length_m();
       arc_m += random.uniform(320.0, 700.0)) {
    const Knot knot = world.path.beside(arc_m, 0.0);
    world.featureless.emplace_back(knot.x, knot.y);
  }
  if (const Status status = populate_town(world, options); !status) return status.error();
  return world;
}

}  // namespace revisit::simulation_internal
