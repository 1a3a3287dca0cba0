// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include <revisit/core/ids.hpp>
#include <revisit/core/refusal.hpp>
#include <revisit/core/trajectory_point.hpp>
#include <revisit/verification/loop_following.hpp>

namespace revisit {

/// Odometry drifts, but not without bounds: a place that lies farther from the query than that cannot be its place,
/// however much it looks like it (an aisle, a corridor of another storey). The bound is several times the drift of
/// LiDAR odometry. Nothing is refused where one of the two has no point, or where tracking was lost in between.
std::optional<Refusal> refuse_elsewhere(const std::optional<TrajectoryPoint>& place,
                                        const std::optional<TrajectoryPoint>& query);

/// The same of the heading, once a pose is found: rooms fit when turned by 90 degrees.
std::optional<Refusal> refuse_heading(const std::optional<TrajectoryPoint>& place,
                                      const std::optional<TrajectoryPoint>& query, const Pose& T_place_query);

/// Log odds that odometry takes from a pose, 0 or less: those of a Gaussian whose deviation is 5 m and a hundredth of
/// the motion in between, at most 8, since odometry may have gone wrong. Like houses in a row are told apart by nothing
/// else.
double odometry_log_odds(const std::optional<TrajectoryPoint>& place, const std::optional<TrajectoryPoint>& query,
                         const Pose& T_place_query);

/// Whether a query that stands at one pose relative to place `a`, as found, cannot stand at the other relative to `b`.
bool are_other_poses(const TrajectoryPoint& a, const Pose& T_a_query, const TrajectoryPoint& b, const Pose& T_b_query);

/// Frames of places that are elsewhere than the point even by half of that bound, the newest first, at most 60: what
/// is learnt from them may be wrong now and then.
std::vector<FrameId> places_elsewhere(const TrajectoryPoints& places, const TrajectoryPoint& point);

}  // namespace revisit
