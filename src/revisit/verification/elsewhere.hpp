// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include <revisit/core/ids.hpp>
#include <revisit/core/refusal.hpp>
#include <revisit/core/trajectory_point.hpp>
#include <revisit/verification/loop_following.hpp>
#include <revisit/verification/loop_probability.hpp>

namespace revisit {

/// Odometry drifts, but not without bounds: a place that lies farther from the query than that cannot be its place,
/// however much it looks like it (an aisle, a corridor of another storey). The bound is several times the drift of
/// LiDAR odometry. Nothing is refused where one of the two has no point, or where tracking was lost in between.
std::optional<Refusal> refuse_elsewhere(const std::optional<TrajectoryPoint>& place,
                                        const std::optional<TrajectoryPoint>& query);

/// The same for the heading of a pose that was found: rooms also fit when turned by 90 degrees.
std::optional<Refusal> refuse_heading(const std::optional<TrajectoryPoint>& place,
                                      const std::optional<TrajectoryPoint>& query, const Pose& T_place_query);

/// Log odds that odometry takes from a pose, 0 or less: those of a Gaussian whose deviation is 0.5 m (2 m where both
/// views are narrow), half a per cent of the motion in between and what gaps brought; beyond three deviations so many
/// that nothing makes up for them. Like houses in a row and the storeys of a building are told apart by nothing else.
/// A pose in the open that is off by no more than 3 % of the motion loses half as many: odometry may have gone wrong
/// unnoticed, and a place that is far surer than look-alikes are shows it. `unknown_log_odds` where odometry says
/// nothing: it lost track in between, or one of the two has no point.
double odometry_log_odds(const std::optional<TrajectoryPoint>& place, const std::optional<TrajectoryPoint>& query,
                         const Pose& T_place_query, const LoopEvidence& evidence, double unknown_log_odds = 0.0);

/// Whether a query cannot stand at both poses at once, one found relative to place `a`, the other to `b`; false where
/// odometry does not know how the places lie to each other.
bool are_other_poses(const TrajectoryPoint& a, const Pose& T_a_query, const TrajectoryPoint& b, const Pose& T_b_query);

/// Frames of places that are elsewhere than the point if odometry drifts half as much (3 % of the way), the newest
/// first, at most 60: what is learnt from them may be wrong now and then.
std::vector<FrameId> places_elsewhere(const TrajectoryPoints& places, const TrajectoryPoint& point);

}  // namespace revisit
