// SPDX-License-Identifier: Apache-2.0
#include <revisit/simulation/internal/movers.hpp>

#include <algorithm>
#include <cmath>

#include <revisit/core/pose.hpp>

namespace revisit::simulation_internal {

void Movers::note_visits(const Path& path) {
  constexpr double kInSight_m = 110.0, kNewVisit_s = 15.0, kLook_s = 1.0;
  for (ParkingSlot& slot : slots) {
    double last_near_s = -1e9;
    for (double time_s = 0.0; time_s <= path.duration_s(); time_s += kLook_s) {
      const Knot self = path.at(time_s);
      if (std::hypot(self.x - slot.at.x, self.y - slot.at.y) > kInSight_m) continue;
      if (time_s - last_near_s > kNewVisit_s) slot.visits_s.push_back(static_cast<float>(time_s - kLook_s));
      last_near_s = time_s;
    }
  }
}

std::optional<std::uint64_t> parked_car(const ParkingSlot& slot, double time_s) {
  const auto visit = static_cast<std::uint64_t>(
      std::upper_bound(slot.visits_s.begin(), slot.visits_s.end(), static_cast<float>(time_s)) - slot.visits_s.begin());
  // One car in three stays from visit to visit.
  const std::uint64_t stays = uniform(mix(slot.seed, 1)) < 0.33f ? 0 : visit;
  const std::uint64_t key = mix(slot.seed, stays, 2);
  if (static_cast<double>(uniform(key)) >= slot.occupancy) return std::nullopt;
  return mix(key);
}

std::optional<Knot> place_of(const Mover& mover, double time_s, const Path& path) {
  if (time_s < mover.from_s || time_s > mover.until_s) return std::nullopt;
  const double since_s = time_s - mover.from_s;
  if (mover.way == Mover::Way::kToAndFro) {
    const double dx = mover.end.x - mover.begin.x, dy = mover.end.y - mover.begin.y, length = std::hypot(dx, dy);
    const double lap = std::fmod((mover.arc_m + since_s * mover.speed_mps) / length, 2.0);
    const double t = lap < 1.0 ? lap : 2.0 - lap;
    return Knot{mover.begin.x + t * dx, mover.begin.y + t * dy, std::atan2(dy, dx) + (lap < 1.0 ? 0.0 : kPi), 0.0};
  }
  const double arc_m =
      mover.way == Mover::Way::kAhead ? path.arc_at(time_s) + mover.arc_m : mover.arc_m + since_s * mover.speed_mps;
  if (arc_m <= 0.0 || arc_m >= path.length_m()) return std::nullopt;
  Knot knot = path.beside(arc_m, mover.left_m);
  if (mover.speed_mps < 0.0) knot.yaw_rad = wrap_angle(knot.yaw_rad + kPi);
  return knot;
}

}  // namespace revisit::simulation_internal
