// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <map>
#include <optional>

#include <revisit/core/ids.hpp>
#include <revisit/core/pose.hpp>

namespace revisit {

/// Where a scan was taken along the sensor's own way: a pose that drifts, good for what lies some metres of the way
/// before and after. Stations of different pieces know nothing of each other.
struct Station {
  int piece = 0;
  Pose T_piece_lidar = Pose::Identity();
  double way_m = 0.0;  ///< from the beginning of the piece; turns count too

  /// The next one on the same piece.
  Station after(const Pose& T_here_next) const;
  /// How much way lies between; nothing where that is too much to tell how the two lie to each other.
  std::optional<double> way_to_m(const Station& other) const;
};

/// Sure loops of the last metres, and where they say that the sensor must be by now: a robot does not leap.
/// Belongs to one thread at a time.
class LoopTrack {
 public:
  /// Places that have a station, by frame.
  using Places = std::map<FrameId, std::optional<Station>>;

  /// Where a loop that was just found says that the query stands.
  struct Expectation {
    FrameId match;  ///< the place that is nearest to it
    Pose T_match_query = Pose::Identity();
  };

  /// Remembers a loop, as sure (log odds) as its own evidence and the loops that led to it make it.
  void add(const Station& query, FrameId match, const Station& place, const Pose& T_match_query, double log_odds);
  /// Where the surest loop of the last metres says that the query stands, seen from the nearest place that is no newer
  /// than `newest`.
  std::optional<Expectation> expected(const std::optional<Station>& query, const Places& places, FrameId newest) const;
  /// The log odds in favour of a pose that the loops of the last metres give it; 0 where none of them agrees.
  double in_favour(const std::optional<Station>& query, const std::optional<Station>& place,
                   const Pose& T_match_query) const;

 private:
  struct Anchor {
    Station query, place;
    FrameId match;
    Pose T_past_now = Pose::Identity();  ///< how the piece of now lies on that of then
    double log_odds = 0.0;
    /// What it is worth some way on.
    double left_after(double way_m) const;
  };
  std::deque<Anchor> anchors_;
};

/// The place nearest to a query that stands at T_match_query from one of them, among those near in time to that one.
std::optional<LoopTrack::Expectation> nearest_place(const LoopTrack::Places& places, FrameId match,
                                                    const Pose& T_match_query, FrameId newest);

}  // namespace revisit
