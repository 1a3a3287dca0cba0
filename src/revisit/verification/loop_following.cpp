// SPDX-License-Identifier: Apache-2.0
#include <revisit/verification/loop_following.hpp>

#include <algorithm>
#include <cmath>
#include <iterator>

namespace revisit {
namespace {

// Chosen on simulated towns along KITTI 05, 06 and 08, seeds 46 to 52 (docs/history.md).
struct Following {
  static constexpr std::size_t kAnchors = 20;    ///< loops remembered
  static constexpr double kReach_m = 30.0;       ///< motion over which odometry is relied on
  static constexpr double kMetresARadian = 5.0;  ///< a turn brings as much error as so many metres
  static constexpr double kLogOddsLostAMetre = 0.1;
  static constexpr double kMostSupport = 8.0;  ///< log odds
  // A pose agrees with a prediction up to so much, and so much more for each metre of motion.
  static constexpr double kTolerance_m = 0.2, kTolerance_mAMetre = 0.02;
  static constexpr double kTolerance_rad = 0.02, kTolerance_radAMetre = 0.001;
};

}  // namespace

std::optional<double> reliable_motion_m(const TrajectoryPoint& a, const TrajectoryPoint& b) {
  if (a.segment != b.segment) return std::nullopt;
  // Both grow together along a segment.
  const double motion_m =
      std::abs((b.travelled_m - a.travelled_m) + Following::kMetresARadian * (b.turned_rad - a.turned_rad));
  return motion_m <= Following::kReach_m ? std::optional(motion_m) : std::nullopt;
}

std::optional<PosePrediction> nearest_place(const TrajectoryPoints& places, FrameId match, const Pose& T_match_query,
                                            FrameId newest) {
  const auto at = places.find(match);
  if (at == places.end() || !at->second) return std::nullopt;
  const auto is_connected = [&](TrajectoryPoints::const_iterator it) {
    return it->second && reliable_motion_m(*it->second, *at->second);
  };
  auto first = at;
  while (first != places.begin() && is_connected(std::prev(first))) --first;
  std::optional<PosePrediction> nearest;
  for (auto it = first; it != places.end() && is_connected(it) && !(newest < it->first); ++it) {
    const Pose T_place_query = T_between(*it->second, *at->second) * T_match_query;
    if (!nearest || T_place_query.translation().norm() < nearest->T_match_query.translation().norm())
      nearest = {it->first, T_place_query};
  }
  return nearest;
}

bool agree(const Pose& T_predicted, const Pose& T_found, double motion_m) {
  const Pose error = T_predicted.inverse() * T_found;
  return error.translation().norm() <= Following::kTolerance_m + Following::kTolerance_mAMetre * motion_m &&
         rotation_angle(error) <= Following::kTolerance_rad + Following::kTolerance_radAMetre * motion_m;
}

double LoopFollowing::carried(double log_odds, double motion_m) {
  return std::max(0.0, std::min(log_odds, Following::kMostSupport) - Following::kLogOddsLostAMetre * motion_m);
}

double LoopFollowing::Anchor::log_odds_after(double motion_m) const { return carried(log_odds, motion_m); }

void LoopFollowing::add(const TrajectoryPoint& query, FrameId match, const TrajectoryPoint& place,
                        const Pose& T_match_query, double log_odds) {
  anchors_.push_back(
      {query, place, match, place.T_segment_lidar * T_match_query * query.T_segment_lidar.inverse(), log_odds});
  if (anchors_.size() > Following::kAnchors) anchors_.pop_front();
}

std::optional<PosePrediction> LoopFollowing::predict(const std::optional<TrajectoryPoint>& query,
                                                     const TrajectoryPoints& places, FrameId newest) const {
  if (!query) return std::nullopt;
  const Anchor* surest = nullptr;
  double most = 0.0;
  for (const Anchor& anchor : anchors_)
    if (const auto motion_m = reliable_motion_m(anchor.query, *query);
        motion_m && anchor.log_odds_after(*motion_m) >= most) {
      surest = &anchor;
      most = anchor.log_odds_after(*motion_m);
    }
  if (surest == nullptr) return std::nullopt;
  return nearest_place(places, surest->match, surest->T_place_query(surest->place, *query), newest);
}

std::optional<Pose> LoopFollowing::pose_at(const std::optional<TrajectoryPoint>& query,
                                           const std::optional<TrajectoryPoint>& place) const {
  if (!query || !place) return std::nullopt;
  std::optional<Pose> T_place_query;
  double most = 0.0;
  for (const Anchor& anchor : anchors_) {
    const auto query_m = reliable_motion_m(anchor.query, *query), place_m = reliable_motion_m(anchor.place, *place);
    if (!query_m || !place_m || anchor.log_odds_after(*query_m + *place_m) <= most) continue;
    most = anchor.log_odds_after(*query_m + *place_m);
    T_place_query = anchor.T_place_query(*place, *query);
  }
  return T_place_query;
}

double LoopFollowing::support_log_odds(const std::optional<TrajectoryPoint>& query,
                                       const std::optional<TrajectoryPoint>& place, const Pose& T_match_query) const {
  double most = 0.0;
  if (!query || !place) return most;
  for (const Anchor& anchor : anchors_) {
    const auto query_m = reliable_motion_m(anchor.query, *query), place_m = reliable_motion_m(anchor.place, *place);
    if (!query_m || !place_m) continue;
    if (agree(anchor.T_place_query(*place, *query), T_match_query, *query_m + *place_m))
      most = std::max(most, anchor.log_odds_after(*query_m));
  }
  return most;
}

}  // namespace revisit
