// SPDX-License-Identifier: Apache-2.0
#include <revisit/verification/backward_following.hpp>

#include <iterator>
#include <utility>

namespace revisit {

void BackwardFollowing::add_refused(Query query) {
  // Odometry says nothing about what was before it lost track.
  if (!refused_.empty() && refused_.back().point.segment != query.point.segment) refused_.clear();
  refused_.push_back(std::move(query));
  if (refused_.size() > kMostQueries) refused_.pop_front();
}

void BackwardFollowing::open_refused() {
  open_.insert(open_.end(), std::move_iterator(refused_.begin()), std::move_iterator(refused_.end()));
  refused_.clear();
}

void BackwardFollowing::add_loop(const TrajectoryPoint& query, FrameId match, const TrajectoryPoint& place,
                                 const Pose& T_match_query, double log_odds) {
  if (!open_.empty()) loops_.add(query, match, place, T_match_query, log_odds);
}

std::optional<BackwardFollowing::Query> BackwardFollowing::next() {
  if (open_.empty()) return std::nullopt;
  Query query = std::move(open_.back());
  open_.pop_back();
  return query;
}

}  // namespace revisit
