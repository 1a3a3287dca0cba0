// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <map>
#include <optional>

#include <revisit/core/ids.hpp>
#include <revisit/core/pose.hpp>
#include <revisit/core/trajectory_point.hpp>

namespace revisit {

/// Points of the places by frame; a place whose odometry failed has none.
using TrajectoryPoints = std::map<FrameId, std::optional<TrajectoryPoint>>;

/// A pose of the query relative to a place that something other than retrieval gives.
struct PosePrediction {
  FrameId match;
  Pose T_match_query = Pose::Identity();
  double log_odds = 0.0;  ///< of the prediction, where it comes from another place that was registered
};

/// Whether the pose found is the one predicted, over so much motion of odometry.
bool agree(const Pose& T_predicted, const Pose& T_found, double motion_m);

/// Metres of motion between two points over which odometry can be relied on: travelled metres, and turns as the metres
/// that bring as much error. Nothing where it is more than that, or where the segments differ.
std::optional<double> reliable_motion_m(const TrajectoryPoint& a, const TrajectoryPoint& b);

/// The place nearest to a query that stands at `T_match_query` from one of them, among those that odometry connects
/// reliably with that one and that are no newer than `newest`.
std::optional<PosePrediction> nearest_place(const TrajectoryPoints& places, FrameId match, const Pose& T_match_query,
                                            FrameId newest);

/// The prior along the trajectory: loops of the last metres, carried on by odometry. They predict where the query
/// stands, and support a pose that agrees with them; a robot does not jump. Belongs to one thread at a time.
class LoopFollowing {
 public:
  /// Remembers a loop with its log odds: those of its own evidence and of the loops before it that support it.
  void add(const TrajectoryPoint& query, FrameId match, const TrajectoryPoint& place, const Pose& T_match_query,
           double log_odds);
  /// What a loop of these log odds adds to one so much motion away.
  static double carried(double log_odds, double motion_m);
  /// Where the surest loop of the last metres says that the query stands, relative to the nearest place that is no
  /// newer than `newest`.
  std::optional<PosePrediction> predict(const std::optional<TrajectoryPoint>& query, const TrajectoryPoints& places,
                                        FrameId newest) const;
  /// T_place_query as the surest loop of the last metres and odometry have it; nothing where no loop reaches both.
  std::optional<Pose> pose_at(const std::optional<TrajectoryPoint>& query,
                              const std::optional<TrajectoryPoint>& place) const;
  /// The log odds that loops of the last metres add to this pose; 0 where none of them agrees with it.
  double support_log_odds(const std::optional<TrajectoryPoint>& query, const std::optional<TrajectoryPoint>& place,
                          const Pose& T_match_query) const;
  void archive(auto& fields) { fields(anchors_); }

 private:
  struct Anchor {
    TrajectoryPoint query, place;
    FrameId match;
    Pose T_place_query_segment = Pose::Identity();  ///< the query's segment in the frame of the place's
    double log_odds = 0.0;
    void archive(auto& fields) { fields(query, place, match, T_place_query_segment, log_odds); }
    double log_odds_after(double motion_m) const;
    /// Of another place and query on the same two segments.
    Pose T_place_query(const TrajectoryPoint& of_place, const TrajectoryPoint& of_query) const {
      return of_place.T_segment_lidar.inverse() * T_place_query_segment * of_query.T_segment_lidar;
    }
  };
  std::deque<Anchor> anchors_;
};

}  // namespace revisit
