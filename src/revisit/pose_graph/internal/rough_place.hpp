// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include <revisit/core/pose.hpp>

namespace revisit::pose_graph_internal {

/// Where key frames of one part lie in the map, and where a receiver placed them, in metres; one row a fix.
struct FixPairs {
  std::vector<Eigen::Vector3d> world, earth;
  std::vector<double> deviation_m;
};

/// Where a part lies before the graph is solved.
struct RoughPlace {
  Pose T_earth_world;
  std::vector<bool> is_near;  ///< of each fix: within four times the median error there
};

/// By least median of squares: up to half of the fixes may be wrong, even if these agree with each other. Nothing where
/// there are fewer than four, or they do not spread far enough to tell a heading.
std::optional<RoughPlace> place_roughly(const FixPairs& pairs);

}  // namespace revisit::pose_graph_internal
