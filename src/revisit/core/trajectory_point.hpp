// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <optional>

#include <revisit/core/pose.hpp>

namespace revisit {

/// A scan on the trajectory that odometry alone gives. Odometry drifts, so that two points tell how their scans lie to
/// each other only where little was travelled between them, and nothing where they are on different segments: between
/// two segments tracking was lost.
struct TrajectoryPoint {
  int segment = 0;
  Pose T_segment_lidar = Pose::Identity();
  double travelled_m = 0.0;  ///< from the origin
  double turned_rad = 0.0;   ///< likewise: the sum of all rotations, whichever way
  /// Segments of one origin have the same coordinates, though tracking failed for a moment in between: good enough to
  /// tell what is far away.
  int origin = 0;
  double gaps_m2 = 0.0;  ///< variance of what the gaps since the origin are off, all together

  void archive(auto& fields) { fields(segment, T_segment_lidar, travelled_m, turned_rad, origin, gaps_m2); }

  /// The next point of the same segment.
  TrajectoryPoint after(const Pose& T_here_next) const {
    return {segment,
            T_segment_lidar * T_here_next,
            travelled_m + T_here_next.translation().norm(),
            turned_rad + rotation_angle(T_here_next),
            origin,
            gaps_m2};
  }
  /// The first point of the next segment, where tracking failed in between: off by a deviation of so many metres.
  TrajectoryPoint after_gap(const Pose& T_here_next, double gap_m) const {
    TrajectoryPoint next = after(T_here_next);
    ++next.segment;
    next.gaps_m2 += gap_m * gap_m;
    return next;
  }
  /// The same as after(), where the pose of the next one is known.
  TrajectoryPoint to(const Pose& T_segment_next) const {
    TrajectoryPoint next = after(T_segment_lidar.inverse() * T_segment_next);
    next.T_segment_lidar = T_segment_next;
    return next;
  }
};

/// Where `b` is seen from `a`, both on one segment.
inline Pose T_between(const TrajectoryPoint& a, const TrajectoryPoint& b) {
  return a.T_segment_lidar.inverse() * b.T_segment_lidar;
}

/// Metres travelled between two points; nothing where they are on different segments.
inline std::optional<double> travelled_between_m(const TrajectoryPoint& a, const TrajectoryPoint& b) {
  if (a.segment != b.segment) return std::nullopt;
  return std::abs(a.travelled_m - b.travelled_m);
}

}  // namespace revisit
