// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <revisit/pose_graph/keyframe_graph.hpp>
#include <revisit/store/stored_map.hpp>

namespace revisit {

/// Compares the places of earlier sessions with what this one saw there: what three sessions in a row saw through is no
/// longer part of the map, what is new is. Its visits (MapStore::add_visit) are then forgotten.
Status compare_with_visits(MapStore& store, const KeyframeGraph& graph, int session);

/// Known ground adds nothing for good: of sessions that are joined with earlier ones, key frames go that are no places,
/// or places beside those of earlier sessions where they were recognised; those whose loops join what is new to the
/// rest stay. True where any went: the map is then to be read again.
Result<bool> remove_known_ground(MapStore& store, const StoredMap& map);

}  // namespace revisit
