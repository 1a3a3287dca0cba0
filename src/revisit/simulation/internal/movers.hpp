// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include <revisit/simulation/internal/builders.hpp>
#include <revisit/simulation/internal/path.hpp>

namespace revisit::simulation_internal {

/// A place where something may stand, another one or none at each visit: a parked car, or what is put beside a road.
struct ParkingSlot {
  enum class For : std::uint8_t { kVehicle, kClutter, kDoor, kFurniture };
  Stand at;
  std::uint64_t seed = 0;
  double occupancy = 0.6;
  double stays = 0.33;      ///< how likely what stands there does so at every visit
  double vans = 1.0 / 9.0;  ///< share of the vehicles
  double shifts_m = 0.0;    ///< along the slot, from visit to visit, at most
  For use = For::kVehicle;
  std::uint64_t visits_before = 0;    ///< on other days
  std::vector<float> changes_s = {};  ///< when it may have changed: while the sensor is far away, between two visits
};

/// Somebody who moves: along the path (with it, or against it), keeping a distance to the sensor's vehicle, or to and
/// fro between two places.
struct Mover {
  enum class Way : std::uint8_t { kAlong, kAhead, kToAndFro };
  Way way = Way::kAlong;
  bool is_person = false;
  VehicleKind vehicle = VehicleKind::kCar;
  std::uint64_t seed = 0;
  double from_s = 0.0, until_s = 0.0;
  double arc_m = 0.0;      ///< along the path, at from_s; kAhead: the least gap, negative behind
  double speed_mps = 0.0;  ///< negative: against the path
  double left_m = 0.0;
  Knot begin, end;           ///< kToAndFro
  bool steps_aside = false;  ///< keeps a metre from the sensor's vehicle, however near it comes
};

/// Cars, people and parked cars that can be seen at a time.
class Movers {
 public:
  std::vector<ParkingSlot> slots;
  std::vector<Mover> movers;

  /// To be called once all slots are there: finds when the path comes within sight of each, on this day.
  void note_visits(const Path& path, int day, double in_sight_m = 65.0);
  /// The solids of what is near the sensor at `time_s`, with their velocities. `ground` gives the height at (x, y).
  template <typename Ground>
  Solids at(double time_s, const Path& path, Ground ground) const;

  static constexpr double kNear_m = 120.0;  ///< who is farther away is not there
};

/// Where the mover is; absent while it is not there.
std::optional<Knot> place_of(const Mover& mover, double time_s, const Path& path);
/// Whether something stands in the slot, and which: a seed.
std::optional<std::uint64_t> occupant(const ParkingSlot& slot, double time_s);

template <typename Ground>
Solids Movers::at(double time_s, const Path& path, Ground ground) const {
  const Knot self = path.at(time_s);
  const auto is_near = [&](double x, double y) {
    return (x - self.x) * (x - self.x) + (y - self.y) * (y - self.y) < kNear_m * kNear_m;
  };
  Solids solids;
  for (const ParkingSlot& slot : slots) {
    if (!is_near(slot.at.x, slot.at.y)) continue;
    const auto seed = occupant(slot, time_s);
    if (!seed) continue;
    Stand at = slot.at;
    const double shift_m = slot.shifts_m * (2.0 * static_cast<double>(uniform(mix(*seed, 3))) - 1.0);
    at.x += shift_m * std::cos(at.yaw_rad);
    at.y += shift_m * std::sin(at.yaw_rad);
    if (slot.use == ParkingSlot::For::kClutter)
      add_clutter(solids, at, *seed);
    else if (slot.use == ParkingSlot::For::kDoor)
      add_box(solids, at, 1.0, 0.06, 0.0, 2.1, Material::kDoor, slot.seed);
    else if (slot.use == ParkingSlot::For::kFurniture)
      add_furniture(solids, at, *seed);
    else
      add_vehicle(solids, at,
                  static_cast<double>(uniform(mix(*seed, 4))) < slot.vans ? VehicleKind::kVan : VehicleKind::kCar,
                  *seed);
  }
  for (const Mover& mover : movers) {
    const auto here = place_of(mover, time_s, path);
    if (!here || !is_near(here->x, here->y)) continue;
    const auto soon = place_of(mover, time_s + 0.05, path);
    const std::size_t first = solids.size();
    const Stand at{here->x, here->y, ground(here->x, here->y), here->yaw_rad};
    if (mover.is_person)
      add_person(solids, at, mover.seed);
    else
      add_vehicle(solids, at, mover.vehicle, mover.seed);
    if (soon)
      for (std::size_t i = first; i < solids.size(); ++i)
        solids[i].velocity = Eigen::Vector2d((soon->x - here->x) / 0.05, (soon->y - here->y) / 0.05).cast<float>();
  }
  return solids;
}

}  // namespace revisit::simulation_internal
