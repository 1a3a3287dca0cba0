// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include <revisit/pose_graph/pose_graph.hpp>

namespace revisit {

/// Sets what each reading is trusted to, by sensor and part. A graph that odometry and loops have settled disagrees
/// with them by their noise, which differs from one to the next, and by its own drift, which grows over many. Where it
/// drifts less than its edges say, readings would bend it: they count less by as much. Few readings count for next to
/// nothing.
void weigh_ups(const PoseGraph& graph, std::span<UpReading> readings);

}  // namespace revisit
