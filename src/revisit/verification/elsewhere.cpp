// SPDX-License-Identifier: Apache-2.0
#include <revisit/verification/elsewhere.hpp>

#include <cmath>

namespace revisit {
namespace {

struct Drift {
  static constexpr double kAlways_m = 15.0;      ///< loops reach so far
  static constexpr double kShare = 0.1;          ///< of the motion in between
  static constexpr double kMetresARadian = 2.0;  ///< a turn brings as much drift as so many metres
  static constexpr double kShareToLearn = 0.05;
};
constexpr std::size_t kMostPlaces = 60;

struct Apart {
  Apart(const TrajectoryPoint& a, const TrajectoryPoint& b)
      : m(T_between(a, b).translation().norm()),
        motion_m(std::abs(b.travelled_m - a.travelled_m) +
                 Drift::kMetresARadian * std::abs(b.turned_rad - a.turned_rad)),
        off_m(std::abs(b.off_m - a.off_m)) {}
  double most_m(double share) const { return Drift::kAlways_m + off_m + share * motion_m; }
  double m, motion_m, off_m;
};

}  // namespace

std::optional<Refusal> refuse_elsewhere(const std::optional<TrajectoryPoint>& place,
                                        const std::optional<TrajectoryPoint>& query) {
  if (!place || !query || place->origin != query->origin) return std::nullopt;
  const Apart apart(*place, *query);
  if (apart.m <= apart.most_m(Drift::kShare)) return std::nullopt;
  return Refusal{Refusal::Reason::kElsewhere, apart.m, apart.most_m(Drift::kShare)};
}

std::vector<FrameId> places_elsewhere(const TrajectoryPoints& places, const TrajectoryPoint& point) {
  std::vector<FrameId> frames;
  for (auto it = places.rbegin(); it != places.rend() && frames.size() < kMostPlaces; ++it) {
    if (!it->second || it->second->origin != point.origin) break;
    const Apart apart(*it->second, point);
    if (apart.m > apart.most_m(Drift::kShareToLearn)) frames.push_back(it->first);
  }
  return frames;
}

}  // namespace revisit
