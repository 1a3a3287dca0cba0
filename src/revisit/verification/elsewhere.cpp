// SPDX-License-Identifier: Apache-2.0
#include <revisit/verification/elsewhere.hpp>

#include <algorithm>
#include <cmath>

namespace revisit {
namespace {

struct Drift {
  static constexpr double kAlways_m = 15.0;                         ///< loops reach so far
  static constexpr double kShare = 0.06;                            ///< of the motion in between
  static constexpr double kMetresARadian = 2.0;                     ///< a turn brings as much drift as so many metres
  static constexpr double kPose_m = 1.0;                            ///< of registered poses
  static constexpr double kDeviation_m = 0.5, kUsualShare = 0.005;  ///< what is usual
  static constexpr double kDeviationOfNarrow_m = 2.0;  ///< a narrow view that turns sees mostly what is new
  static constexpr double kMostDeviations = 3.0;       ///< more is a mistake of odometry that it did not notice
  static constexpr double kMistakenShare = 0.03;       ///< of the motion, by which such mistakes are off
  static constexpr double kMistaken_log_odds = 10.0, kNever_log_odds = 20.0;
  // Of the heading.
  static constexpr double kAlways_deg = 40.0, kDegreesAMetre = 0.02;
};
constexpr std::size_t kMostPlaces = 60;

struct Apart {
  Apart(const TrajectoryPoint& a, const TrajectoryPoint& b)
      : m(T_between(a, b).translation().norm()),
        motion_m(std::abs(b.travelled_m - a.travelled_m) +
                 Drift::kMetresARadian * std::abs(b.turned_rad - a.turned_rad)),
        gaps_m(std::sqrt(std::abs(b.gaps_m2 - a.gaps_m2))) {}
  double drift_m(double share) const { return gaps_m + share * motion_m; }
  double most_m(double share) const { return Drift::kAlways_m + drift_m(share); }
  double m, motion_m, gaps_m;
};

}  // namespace

std::optional<Refusal> refuse_elsewhere(const std::optional<TrajectoryPoint>& place,
                                        const std::optional<TrajectoryPoint>& query) {
  if (!place || !query || place->origin != query->origin) return std::nullopt;
  const Apart apart(*place, *query);
  if (apart.m <= apart.most_m(Drift::kShare)) return std::nullopt;
  return Refusal{Refusal::Reason::kElsewhere, apart.m, apart.most_m(Drift::kShare)};
}

std::optional<Refusal> refuse_heading(const std::optional<TrajectoryPoint>& place,
                                      const std::optional<TrajectoryPoint>& query, const Pose& T_place_query) {
  if (!place || !query || place->origin != query->origin) return std::nullopt;
  const double off_deg = to_degrees(rotation_angle(T_between(*place, *query).inverse() * T_place_query));
  const double most_deg = Drift::kAlways_deg + Drift::kDegreesAMetre * Apart(*place, *query).motion_m;
  if (off_deg <= most_deg) return std::nullopt;
  return Refusal{Refusal::Reason::kOtherHeading, off_deg, most_deg};
}

double odometry_log_odds(const std::optional<TrajectoryPoint>& place, const std::optional<TrajectoryPoint>& query,
                         const Pose& T_place_query, const LoopEvidence& evidence, double unknown_log_odds) {
  if (!place || !query || place->origin != query->origin) return unknown_log_odds;
  const double off_m = (T_between(*place, *query).inverse() * T_place_query).translation().norm();
  const Apart apart(*place, *query);
  const double always_m = evidence.both_are_narrow ? Drift::kDeviationOfNarrow_m : Drift::kDeviation_m;
  const double deviations = off_m / std::hypot(always_m + Drift::kUsualShare * apart.motion_m, apart.gaps_m);
  if (deviations <= Drift::kMostDeviations) return -0.5 * deviations * deviations;
  const bool may_be_mistaken =
      evidence.in_the_open && !evidence.one_in_a_room && off_m <= always_m + apart.drift_m(Drift::kMistakenShare);
  return may_be_mistaken ? -Drift::kMistaken_log_odds : -Drift::kNever_log_odds;
}

bool are_other_poses(const TrajectoryPoint& a, const Pose& T_a_query, const TrajectoryPoint& b, const Pose& T_b_query) {
  if (a.origin != b.origin) return false;
  const Pose apart = (T_between(b, a) * T_a_query).inverse() * T_b_query;
  return apart.translation().norm() > Drift::kPose_m + Apart(a, b).drift_m(Drift::kShare);
}

std::vector<FrameId> places_elsewhere(const TrajectoryPoints& places, const TrajectoryPoint& point) {
  std::vector<FrameId> frames;
  for (auto it = places.rbegin(); it != places.rend() && frames.size() < kMostPlaces; ++it) {
    if (!it->second || it->second->origin != point.origin) break;
    const Apart apart(*it->second, point);
    if (apart.m > apart.most_m(Drift::kMistakenShare)) frames.push_back(it->first);
  }
  return frames;
}

}  // namespace revisit
