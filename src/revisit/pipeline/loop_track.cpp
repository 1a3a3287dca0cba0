// SPDX-License-Identifier: Apache-2.0
#include <revisit/pipeline/loop_track.hpp>

#include <algorithm>
#include <cmath>
#include <iterator>

namespace revisit {
namespace {

constexpr std::size_t kAnchors = 20;
constexpr double kReach_m = 30.0;      // of way, on which the sensor's own motion can be relied on
constexpr double kLostAMetre = 0.1;    // log odds
constexpr double kMostInFavour = 8.0;  // log odds that loops shortly before can add
constexpr double kOff_m = 0.2, kOffAMetre_m = 0.02, kOff_rad = 0.02, kOffAMetre_rad = 0.001;
constexpr double kMetresARad = 5.0;  // a turn costs what so much way does

}  // namespace

Station Station::after(const Pose& T_here_next) const {
  return {piece, T_piece_lidar * T_here_next,
          way_m + T_here_next.translation().norm() + kMetresARad * rotation_angle(T_here_next)};
}

std::optional<double> Station::way_to_m(const Station& other) const {
  const double between_m = std::abs(other.way_m - way_m);
  return piece == other.piece && between_m <= kReach_m ? std::optional(between_m) : std::nullopt;
}

double LoopTrack::Anchor::left_after(double way_m) const {
  return std::max(0.0, std::min(log_odds, kMostInFavour) - kLostAMetre * way_m);
}

void LoopTrack::add(const Station& query, FrameId match, const Station& place, const Pose& T_match_query,
                    double log_odds) {
  anchors_.push_back(
      {query, place, match, place.T_piece_lidar * T_match_query * query.T_piece_lidar.inverse(), log_odds});
  if (anchors_.size() > kAnchors) anchors_.pop_front();
}

std::optional<LoopTrack::Expectation> LoopTrack::expected(const std::optional<Station>& query, const Places& places,
                                                          FrameId newest) const {
  const Anchor* best = nullptr;
  double most = 0.0;
  for (const Anchor& anchor : anchors_)
    if (const auto way_m = query ? anchor.query.way_to_m(*query) : std::nullopt;
        way_m && anchor.left_after(*way_m) >= most) {
      best = &anchor;
      most = anchor.left_after(*way_m);
    }
  if (best == nullptr) return std::nullopt;
  const Pose T_match_query = best->place.T_piece_lidar.inverse() * best->T_past_now * query->T_piece_lidar;
  return nearest_place(places, best->match, T_match_query, newest);
}

double LoopTrack::in_favour(const std::optional<Station>& query, const std::optional<Station>& place,
                            const Pose& T_match_query) const {
  double most = 0.0;
  if (!query || !place) return most;
  for (const Anchor& anchor : anchors_) {
    const auto way_m = anchor.query.way_to_m(*query), past_way_m = anchor.place.way_to_m(*place);
    if (!way_m || !past_way_m) continue;
    const Pose T_expected = place->T_piece_lidar.inverse() * anchor.T_past_now * query->T_piece_lidar;
    const Pose off = T_expected.inverse() * T_match_query;
    const double both_m = *way_m + *past_way_m;
    if (off.translation().norm() <= kOff_m + kOffAMetre_m * both_m &&
        rotation_angle(off) <= kOff_rad + kOffAMetre_rad * both_m)
      most = std::max(most, anchor.left_after(*way_m));
  }
  return most;
}

std::optional<LoopTrack::Expectation> nearest_place(const LoopTrack::Places& places, FrameId match,
                                                    const Pose& T_match_query, FrameId newest) {
  const auto at = places.find(match);
  if (at == places.end() || !at->second) return std::nullopt;
  const auto is_near = [&](const LoopTrack::Places::const_iterator& it) {
    return it->second && it->second->way_to_m(*at->second);
  };
  auto first = at;
  while (first != places.begin() && is_near(std::prev(first))) --first;
  std::optional<LoopTrack::Expectation> nearest;
  for (auto it = first; it != places.end() && is_near(it) && !(newest < it->first); ++it) {
    const Pose T_place_query = it->second->T_piece_lidar.inverse() * at->second->T_piece_lidar * T_match_query;
    if (!nearest || T_place_query.translation().norm() < nearest->T_match_query.translation().norm())
      nearest = {it->first, T_place_query};
  }
  return nearest;
}

}  // namespace revisit
