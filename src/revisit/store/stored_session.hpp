// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include <revisit/config/parameters.hpp>
#include <revisit/core/exclusion.hpp>
#include <revisit/core/trajectory_point.hpp>
#include <revisit/descriptors/intensity_scan_context.hpp>
#include <revisit/odometry/keyframe_selection.hpp>
#include <revisit/odometry/odometry.hpp>
#include <revisit/pose_graph/keyframe_graph.hpp>
#include <revisit/store/map_store.hpp>
#include <revisit/store/sensor_facts.hpp>

namespace revisit {

/// What a run left in its map, checked and put together: a later run continues it, or localises in it.
struct StoredSession {
  struct Keyframe {
    FrameTime frame;
    TrajectoryPoint point;
    std::optional<KeyframeGraph::OdometryEdge> edge;  ///< from the one before; absent for the first
  };
  std::vector<Keyframe> keyframes;
  std::vector<LoopConstraint> loops;  ///< between them, in the order in which they entered
  std::vector<StoredScan> scans;
  std::optional<SensorFacts> sensor;
};

/// An error where the rows are damaged or contradict each other.
Result<StoredSession> read_session(const MapStore& store);

/// The graph as it was, its key frames settled.
Status restore_graph(const StoredSession& session, KeyframeGraph& graph);

/// Calls `restore` for each key frame that is a place: those at places known before are none. An error where one is
/// damaged, or was described on another grid.
using RestorePlace =
    std::function<void(const FrameTime&, const IntensityScanContext&, const std::optional<TrajectoryPoint>&)>;
Status restore_places(const MapStore& store, const StoredSession& session, const DescriptorOptions& grid,
                      const RestorePlace& restore);

/// The surroundings from the latest key frames that have a cloud, then the motion from the last two scans.
Status restore_odometry(const MapStore& store, const StoredSession& session, Odometry& odometry,
                        KeyframeSelection& selection);

}  // namespace revisit
