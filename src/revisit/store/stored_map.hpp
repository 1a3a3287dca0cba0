// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include <revisit/config/parameters.hpp>
#include <revisit/core/exclusion.hpp>
#include <revisit/core/trajectory_point.hpp>
#include <revisit/descriptors/intensity_scan_context.hpp>
#include <revisit/pose_graph/keyframe_graph.hpp>
#include <revisit/store/map_store.hpp>

namespace revisit {

/// What runs left in a map, checked and put together: a later run continues it, or localises in it.
struct StoredMap {
  struct Keyframe {
    FrameTime frame;
    TrajectoryPoint point;
    std::optional<KeyframeGraph::OdometryEdge> edge;  ///< from the one before; absent for the first
    std::optional<StoredMapPose> settled;             ///< absent where it came after the graph was settled
  };
  std::vector<StoredSession> sessions;
  std::vector<Keyframe> keyframes;
  std::vector<LoopConstraint> loops;  ///< between them, in the order in which they entered
};

/// An error where the rows are damaged or contradict each other.
Result<StoredMap> read_map(const MapStore& store);

/// The graph as it was, its key frames settled.
Status restore_graph(const StoredMap& map, KeyframeGraph& graph);

/// An error where places are described on another grid than the parameters say.
Status check_grid(const DescriptorView& place, const DescriptorOptions& grid);

/// Calls `restore` for each key frame that is a place: those at places known before are none. An error where one is
/// damaged, or was described on another grid.
using RestorePlace = std::function<void(const StoredMap::Keyframe&, const IntensityScanContext&)>;
Status restore_places(const MapStore& store, const StoredMap& map, const DescriptorOptions& grid,
                      const RestorePlace& restore);

/// The point of a place whose pose in the map is known: those of one part lie to each other as the map has them,
/// whatever was travelled between them. Its segment is none of those that odometry counts.
TrajectoryPoint point_in_map(const Pose& T_map_lidar, int part);

}  // namespace revisit
