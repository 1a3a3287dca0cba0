// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include <revisit/simulation/internal/builders.hpp>
#include <revisit/simulation/internal/path.hpp>

namespace revisit::simulation_internal {

/// A place where a car may be parked: another one, or none, at each visit.
struct ParkingSlot {
  Stand at;
  std::uint64_t seed = 0;
  double occupancy = 0.6;
  std::vector<float> changes_s;  ///< when the car may have changed: while the sensor is far away, between two visits
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

  /// To be called once all slots are there: finds when the path comes near each.
  void note_visits(const Path& path);
  /// The solids of what is near the sensor at `time_s`, with their velocities. `ground` gives the height at (x, y).
  template <typename Ground>
  Solids at(double time_s, const Path& path, Ground ground) const;

  static constexpr double kNear_m = 120.0;  ///< who is farther away is not there
};

/// Where the mover is; absent while it is not there.
std::optional<Knot> place_of(const Mover& mover, double time_s, const Path& path);
/// Whether a car is parked in the slot, and which: a seed.
std::optional<std::uint64_t> parked_car(const ParkingSlot& slot, double time_s);

template <typename Ground>
Solids Movers::at(double time_s, const Path& path, Ground ground) const {
  const Knot self = path.at(time_s);
  const auto is_near = [&](double x, double y) {
    return (x - self.x) * (x - self.x) + (y - self.y) * (y - self.y) < kNear_m * kNear_m;
  };
  Solids solids;
  for (const ParkingSlot& slot : slots) {
    if (!is_near(slot.at.x, slot.at.y)) continue;
    if (const auto seed = parked_car(slot, time_s))
      add_vehicle(solids, slot.at, *seed % 9 == 0 ? VehicleKind::kVan : VehicleKind::kCar, *seed);
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
