// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <revisit/pose_graph/keyframe_graph.hpp>
#include <revisit/store/map_store.hpp>

namespace revisit {

/// Compares the places of earlier sessions with what this one saw there: what three sessions in a row saw through is no
/// longer part of the map, what is new is. Its visits (MapStore::add_visit) are then forgotten.
Status compare_with_visits(MapStore& store, const KeyframeGraph& graph, int session);

}  // namespace revisit
