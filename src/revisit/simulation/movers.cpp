// SPDX-License-Identifier: Apache-2.0
#include <revisit/simulation/internal/movers.hpp>

#include <algorithm>
#include <cmath>

#include <revisit/core/pose.hpp>

namespace revisit::simulation_internal {

void Movers::note_visits(const Path& path, int day, double in_sight_m) {
  constexpr double kAway_s = 8.0, kLook_s = 0.5;
  constexpr std::uint64_t kVisitsADay = 1000;  // more than there are
  for (ParkingSlot& slot : slots) {
    slot.visits_before = kVisitsADay * static_cast<std::uint64_t>(day);
    // Between two visits, the car changes while the sensor is farthest away.
    double last_near_s = -1.0, farthest_m = 0.0, farthest_s = 0.0;
    for (double time_s = 0.0; time_s <= path.duration_s(); time_s += kLook_s) {
      const Knot self = path.at(time_s);
      const double distance_m = std::hypot(self.x - slot.at.x, self.y - slot.at.y);
      if (distance_m > in_sight_m) {
        if (distance_m > farthest_m) {
          farthest_m = distance_m;
          farthest_s = time_s;
        }
        continue;
      }
      if (last_near_s >= 0.0 && time_s - last_near_s > kAway_s)
        slot.changes_s.push_back(static_cast<float>(farthest_s));
      last_near_s = time_s;
      farthest_m = 0.0;
    }
  }
}

std::optional<std::uint64_t> occupant(const ParkingSlot& slot, double time_s) {
  const auto changes = std::upper_bound(slot.changes_s.begin(), slot.changes_s.end(), static_cast<float>(time_s));
  const auto visit = slot.visits_before + static_cast<std::uint64_t>(changes - slot.changes_s.begin());
  const std::uint64_t stays = static_cast<double>(uniform(mix(slot.seed, 1))) < slot.stays ? 0 : visit;
  const std::uint64_t key = mix(slot.seed, stays, 2);
  if (static_cast<double>(uniform(key)) >= slot.occupancy) return std::nullopt;
  return mix(key);
}

namespace {

// The gap to one who drives ahead or behind: it comes from out of sight, stays for a while, and goes again.
double gap_m(const Mover& mover, double time_s) {
  const double middle_s = 0.5 * (mover.from_s + mover.until_s), half_s = 0.5 * (mover.until_s - mover.from_s);
  const double away = std::clamp((std::abs(time_s - middle_s) / half_s - 0.3) / 0.7, 0.0, 1.0);
  const double side = mover.arc_m > 0.0 ? 1.0 : -1.0;
  return mover.arc_m + side * (Movers::kNear_m + 10.0 - std::abs(mover.arc_m)) * away * away * (3.0 - 2.0 * away);
}

// From two metres on it gives way, and never comes nearer than one.
void step_aside(Knot& knot, const Knot& self) {
  constexpr double kGivesWay_m = 2.0;
  const double dx = knot.x - self.x, dy = knot.y - self.y, distance_m = std::max(1e-3, std::hypot(dx, dy));
  if (distance_m >= kGivesWay_m) return;
  const double keeps = (0.5 * kGivesWay_m + 0.5 * distance_m) / distance_m;
  knot.x = self.x + keeps * dx;
  knot.y = self.y + keeps * dy;
}

}  // namespace

std::optional<Knot> place_of(const Mover& mover, double time_s, const Path& path) {
  if (time_s < mover.from_s || time_s > mover.until_s) return std::nullopt;
  const double since_s = time_s - mover.from_s;
  if (mover.way == Mover::Way::kToAndFro) {
    const double dx = mover.end.x - mover.begin.x, dy = mover.end.y - mover.begin.y, length = std::hypot(dx, dy);
    const double lap = std::fmod((mover.arc_m + since_s * mover.speed_mps) / length, 2.0);
    const double t = lap < 1.0 ? lap : 2.0 - lap;
    Knot knot{mover.begin.x + t * dx, mover.begin.y + t * dy, std::atan2(dy, dx) + (lap < 1.0 ? 0.0 : kPi), 0.0};
    if (mover.steps_aside) step_aside(knot, path.at(time_s));
    return knot;
  }
  const double arc_m = mover.way == Mover::Way::kAhead ? path.arc_at(time_s) + gap_m(mover, time_s)
                                                       : mover.arc_m + since_s * mover.speed_mps;
  if (arc_m <= 0.0 || arc_m >= path.length_m()) return std::nullopt;
  Knot knot = path.beside(arc_m, mover.left_m);
  if (mover.speed_mps < 0.0) knot.yaw_rad = wrap_angle(knot.yaw_rad + kPi);
  return knot;
}

}  // namespace revisit::simulation_internal
