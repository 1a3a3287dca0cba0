// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>

#include <revisit/core/ids.hpp>
#include <revisit/core/pose.hpp>

namespace revisit {

/// An earlier place that looks like the query, as retrieval found it.
struct LoopCandidate {
  FrameId match;
  double geometry_score = 0.0;   ///< Phi_g, eq. 8: [0, 1], at the best column shift
  double intensity_score = 0.0;  ///< Phi_i, eq. 10: [0, 1], at the same shift
  int shift_columns = 0;         ///< k: column j of the query lies on column j + k of the match
  double yaw_rad = 0.0;          ///< heading of the query in the match's frame, k * 2 pi / N_s, in [-pi, pi)

  /// What retrieval ranks by, the summand of eq. 11: [0, 2].
  double score() const { return geometry_score + intensity_score; }
};

/// A verified revisit: a relative pose for the pose graph.
struct LoopConstraint {
  FrameId query, match;
  Pose T_match_query = Pose::Identity();  ///< maps the query's LiDAR frame into the match's, metres
  double inlier_ratio = 0.0;              ///< the smaller of both directions, [0, 1]
  double rmse_m = 0.0;                    ///< point-to-plane, over the inliers
  double probability = 1.0;               ///< that the pose is right (docs/accuracy.md)
  double score = 0.0;                     ///< orders loops by confidence, larger is surer (docs/method.md, section 7)
  /// Inverse covariance of xi where the true pose is T_match_query * small_motion(xi): metres, then radians, in the
  /// query's frame. Small along what the scans do not fix: the length of a corridor.
  Matrix6 information = Matrix6::Identity();
  double own_log_odds = 0.0;  ///< that the pose is right, by both scans alone: not by the loops before
  bool in_the_open = true;    ///< or in rooms

  void archive(auto& fields) {
    fields(query, match, T_match_query, inlier_ratio, rmse_m, probability, score, information, own_log_odds,
           in_the_open);
  }
};

}  // namespace revisit
