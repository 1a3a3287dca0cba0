// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <deque>
#include <optional>
#include <vector>

#include <revisit/verification/candidate_registration.hpp>
#include <revisit/verification/loop_following.hpp>

namespace revisit {

/// Loops are followed backwards, too. Where a revisit begins, little may fit until more is in sight; the loop that is
/// found then says where the queries before it stood. Keeps the queries that were refused since the last loop, and
/// gives them back one by one, the newest first. Belongs to one thread at a time.
class BackwardFollowing {
 public:
  /// A query that was refused, and the poses at which it was registered.
  struct Query {
    FrameId frame, newest;              ///< `newest`: of the places that may answer
    std::size_t searchable_places = 0;  ///< up to `newest`
    TrajectoryPoint point;
    std::vector<RegisteredPose> registered;
  };
  void add_refused(Query query);
  /// A loop was found: the queries refused before it can be tested.
  void open_refused();
  /// A loop that leads back to those that can be tested, as for LoopFollowing::add().
  void add_loop(const TrajectoryPoint& query, FrameId match, const TrajectoryPoint& place, const Pose& T_match_query,
                double log_odds);
  /// The next one to test; nothing where no loop leads back to any.
  std::optional<Query> next();
  /// The query that next() gave is out of reach of all loops: so are those before it.
  void stop() { open_.clear(); }
  /// What predicts and supports poses of the queries that next() gives.
  const LoopFollowing& loops() const { return loops_; }

 private:
  static constexpr std::size_t kMostQueries = 200;  ///< 20 s at 10 Hz

  std::deque<Query> refused_;  ///< since the last loop
  std::deque<Query> open_;     ///< before it, not yet tested
  LoopFollowing loops_;
};

}  // namespace revisit
