// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <vector>

#include <revisit/core/pose.hpp>
#include <revisit/core/result.hpp>
#include <revisit/pose_graph/pose_graph.hpp>

namespace revisit {

/// Where a receiver placed a node: metres east, north and up of a point of the earth. Its error is that of the receiver
/// at the moment, which is nearly the same a second later: fixes are to lie apart (docs/slam.md, "GPS").
struct EarthFix {
  std::size_t node = 0;
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero(), deviation_m = Eigen::Vector3d::Ones();
};

/// Moves the nodes to where all edges and these fixes agree best; a fix that contradicts the rest loses its weight as a
/// loop does, and so do up to two fifths of the fixes that are wrong in one piece and agree with each other.
/// `part_of_node`: which part of the graph a node is in; parts that nothing joins are placed each by its own fixes. For
/// each part, by its number, T_earth_world; nothing for those whose fixes do not fix a heading.
Result<std::vector<std::optional<Pose>>> settle_on_earth(PoseGraph& graph, std::span<const EarthFix> fixes,
                                                         std::span<const int> part_of_node);

}  // namespace revisit
