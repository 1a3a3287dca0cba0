// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <revisit/core/log.hpp>
#include <revisit/core/result.hpp>
#include <revisit/pose_graph/keyframe_graph.hpp>
#include <revisit/store/map_store.hpp>

namespace revisit {

/// Moves the key frames to where odometry, loops and what the store has of GPS and gravity agree best, and stores how
/// the map lies on the earth.
Status settle_map(MapStore& store, KeyframeGraph& graph, const LogSink& log);

}  // namespace revisit
