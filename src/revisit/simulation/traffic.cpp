// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include <revisit/simulation/internal/footprints.hpp>
#include <revisit/simulation/internal/world.hpp>

namespace revisit::simulation_internal {
namespace {

// Lets vehicles and people move where there is room for them.
class TrafficPlanner {
 public:
  explicit TrafficPlanner(World& world) : world_(world), random_(mix(world.seed_of_day(), 31)) {
    for (const Solid& solid : world.solids) {
      const double foot_m =
          static_cast<double>(solid.centre.z() - solid.half.z()) -
          world.terrain.height(static_cast<double>(solid.centre.x()), static_cast<double>(solid.centre.y()));
      if (foot_m > 2.0) continue;
      blocked_.take({static_cast<double>(solid.centre.x()), static_cast<double>(solid.centre.y()),
                     std::atan2(static_cast<double>(solid.sin_yaw), static_cast<double>(solid.cos_yaw)),
                     static_cast<double>(solid.half.x()), static_cast<double>(solid.half.y())});
    }
  }

  // Every few seconds somebody is met; who would run into something is sent away.
  void plan(double traffic) {
    const double alongside_until = 0.5 + 0.02 * world_.difficulty;
    traffic *= 1.0 + 0.3 * world_.difficulty;
    for (double time_s = 3.0; time_s < world_.path.duration_s() && traffic > 0.0;
         time_s += random_.uniform(1.0, 5.0) / traffic) {
      const double kind = random_.uniform();
      constexpr int kTries = 12;
      for (int i = 0; i < kTries; ++i) {
        const Mover mover = kind < 0.35              ? oncoming(time_s)
                            : kind < 0.5             ? ahead(time_s)
                            : kind < alongside_until ? alongside(time_s)
                                                     : on_foot(time_s);
        if (!has_room(mover)) continue;
        world_.movers.movers.push_back(mover);
        break;
      }
    }
  }

 private:
  static constexpr double kOutOfSight_m = Movers::kNear_m + 10.0;

  VehicleKind any_vehicle() {
    return random_.chance(0.75 - 0.2 * world_.difficulty) ? VehicleKind::kCar
           : random_.chance(0.7)                          ? VehicleKind::kVan
                                                          : VehicleKind::kTruck;
  }
  // There while it is within sight along the path, before and after the sensor passes it at `time_s`.
  Mover along(double time_s, double speed_mps) {
    Mover mover;
    mover.seed = random_.next();
    mover.speed_mps = speed_mps;
    const double half_s = kOutOfSight_m / std::abs(speed_mps);
    mover.from_s = time_s - half_s;
    mover.until_s = time_s + half_s;
    mover.arc_m = world_.path.arc_at(time_s) - half_s * speed_mps;
    return mover;
  }
  Mover oncoming(double time_s) {
    Mover mover = along(time_s, -random_.uniform(6.0, 12.0));
    mover.vehicle = any_vehicle();
    mover.left_m = 2.9;
    return mover;
  }
  Mover ahead(double time_s) {
    Mover mover;
    mover.seed = random_.next();
    mover.way = Mover::Way::kAhead;
    mover.vehicle = any_vehicle();
    mover.from_s = time_s - 20.0;
    mover.until_s = time_s + 20.0;
    mover.arc_m = (random_.chance(0.7) ? 1.0 : -1.0) * random_.uniform(16.0, 40.0);
    return mover;
  }
  // A lorry or a bus that drives beside the sensor for some seconds, and hides what lies behind it.
  Mover alongside(double time_s) {
    Mover mover = ahead(time_s);
    mover.vehicle = random_.chance(0.6) ? VehicleKind::kLorry : VehicleKind::kTruck;
    mover.from_s = time_s - 8.0;
    mover.until_s = time_s + 8.0;
    mover.arc_m = random_.uniform(-9.0, 12.0);
    mover.left_m = random_.uniform(3.2, 3.8);
    return mover;
  }
  // To and fro on the pavement, while the sensor is in sight.
  Mover on_foot(double time_s) {
    Mover mover;
    mover.seed = random_.next();
    mover.way = Mover::Way::kToAndFro;
    mover.is_person = true;
    mover.speed_mps = random_.uniform(0.9, 1.7);
    const double from_kerb_m = random_.uniform(0.2, 2.2);
    const double left_m = random_.chance(0.6) ? static_cast<double>(Roads::kRightEdge_m) - from_kerb_m
                                              : static_cast<double>(Roads::kLeftEdge_m) + from_kerb_m;
    const double arc_m = world_.path.arc_at(time_s) + random_.uniform(-20.0, 20.0);
    mover.begin = world_.path.beside(arc_m, left_m);
    mover.end = world_.path.beside(arc_m + random_.uniform(4.0, 20.0), left_m);
    const auto is_near = [&](double t) {
      const Knot self = world_.path.at(t);
      return t >= 0.0 && t <= world_.path.duration_s() &&
             std::hypot(self.x - mover.begin.x, self.y - mover.begin.y) < kOutOfSight_m + 20.0;
    };
    for (mover.from_s = time_s; is_near(mover.from_s);) mover.from_s -= 0.5;
    for (mover.until_s = time_s; is_near(mover.until_s);) mover.until_s += 0.5;
    return mover;
  }

  // Whether it keeps clear of all that stands, and of the sensor's vehicle, all the time.
  bool has_room(const Mover& mover) {
    const double half_length_m = mover.is_person ? 0.2 : 2.0, half_width_m = mover.is_person ? 0.2 : 0.75;
    const double clear_m = mover.is_person ? 1.6 : 2.3;
    const double from_s = std::max(0.0, mover.from_s), until_s = std::min(world_.path.duration_s(), mover.until_s);
    for (double time_s = from_s; time_s <= until_s; time_s += 0.25) {
      const auto at = place_of(mover, time_s, world_.path);
      if (!at) return false;  // the path ends, and it would vanish in full view
      const Knot self = world_.path.at(time_s);
      if (std::hypot(at->x - self.x, at->y - self.y) < clear_m) return false;
      if (!blocked_.is_free({at->x, at->y, at->yaw_rad, half_length_m, half_width_m})) return false;
    }
    return true;
  }

  World& world_;
  Random random_;
  Footprints blocked_;
};

}  // namespace

void plan_traffic(World& world, double traffic) { TrafficPlanner(world).plan(traffic); }

}  // namespace revisit::simulation_internal
