// SPDX-License-Identifier: Apache-2.0
#include <revisit/store/stored_map.hpp>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <set>
#include <string>

#include <revisit/core/text.hpp>
#include <revisit/store/keyframe_bytes.hpp>

namespace revisit {
namespace {

Error out_of_order(FrameId keyframe) {
  return {"key " + to_text(keyframe) + " of the map does not follow the one before it"};
}

Result<std::vector<StoredMap::Keyframe>> join(const MapStore& store, const std::vector<StoredKeyframe>& rows,
                                              const std::vector<StoredEdge>& edges) {
  std::map<FrameId, const StoredEdge*> from_last;
  for (const StoredEdge& edge : edges)
    if (!edge.loop) from_last[edge.to] = &edge;
  std::vector<StoredMap::Keyframe> keyframes;
  for (const StoredKeyframe& row : rows) {
    const auto edge = from_last.find(row.frame);
    if (keyframes.empty() != (edge == from_last.end())) return out_of_order(row.frame);
    if (!keyframes.empty() && edge->second->from != keyframes.back().frame.frame) return out_of_order(row.frame);
    if (!std::isfinite(row.stamp_s) || (keyframes.empty() && row.starts_segment))
      return store.damaged("time or beginning", row.frame);
    StoredMap::Keyframe keyframe{
        {row.frame, row.stamp_s}, {.T_segment_lidar = row.T_odom_lidar}, std::nullopt, std::nullopt};
    if (!keyframes.empty()) {
      const TrajectoryPoint& last = keyframes.back().point;
      if (row.starts_segment)
        keyframe.point.segment = keyframe.point.origin = last.segment + 1;
      else
        keyframe.point = last.to(row.T_odom_lidar);
      keyframe.edge = {edge->second->T_from_to, edge->second->information};
    }
    keyframes.push_back(keyframe);
  }
  return keyframes;
}

}  // namespace

namespace {

Result<StoredMap> read_held_map(const MapStore& store) {
  auto sessions = store.sessions();
  if (!sessions) return sessions.error();
  const auto rows = store.keyframes();
  if (!rows) return rows.error();
  const auto edges = store.edges();
  if (!edges) return edges.error();
  const auto poses = store.map_poses();
  if (!poses) return poses.error();
  auto keyframes = join(store, *rows, *edges);
  if (!keyframes) return keyframes.error();
  StoredMap map{*std::move(sessions), *std::move(keyframes), {}};
  for (std::size_t i = 0; i < map.sessions.size(); ++i)
    if (map.sessions[i].id != static_cast<int>(i))
      return Error{"sessions of the map are not numbered 0, 1, ...: one has the number " +
                   std::to_string(map.sessions[i].id)};
  if (!map.keyframes.empty() && map.keyframes.front().frame.frame.value < 0)
    return Error{"a key frame of the map has the number " + std::to_string(map.keyframes.front().frame.frame.value)};
  if (!map.keyframes.empty() &&
      (map.sessions.empty() || session_of(map.keyframes.back().frame.frame) > map.sessions.back().id))
    return Error{"key frames of the map belong to a session that it does not know"};
  auto next = poses->begin();
  std::set<FrameId> known;
  for (auto& each : map.keyframes) {
    known.insert(each.frame.frame);
    if (next != poses->end() && next->keyframe == each.frame.frame) each.settled = *next++;
  }
  if (next != poses->end())
    return Error{"the map has a pose for " + to_text(next->keyframe) + ", which is no key frame"};
  for (const StoredEdge& edge : *edges) {
    if (!edge.loop) continue;
    if (edge.from == edge.to || !known.contains(edge.from) || !known.contains(edge.to))
      return Error{"a loop of the map names " + to_text(edge.to) + ", which is no key frame of it"};
    map.loops.push_back(*edge.loop);
  }
  return map;
}

}  // namespace

Result<StoredMap> read_map(const MapStore& store) {
  if (store.is_held()) return read_held_map(store);
  if (const Status held = store.hold(); !held) return held.error();
  auto map = read_held_map(store);
  if (const Status released = store.release(); !released && map) return released.error();
  return map;
}

Status restore_graph(const StoredMap& map, KeyframeGraph& graph) {
  bool is_settled = true;
  for (const auto& each : map.keyframes) {
    graph.add_keyframe(each.frame.frame, each.point, each.edge,
                       each.settled ? std::optional(each.settled->T_map_lidar) : std::nullopt);
    is_settled = is_settled && each.settled;
  }
  for (const LoopConstraint& loop : map.loops) graph.restore_loop(loop, is_settled);
  if (!is_settled) return graph.settle();
  graph.set_settled();
  return ok();
}

TrajectoryPoint point_in_map(const Pose& T_map_lidar, int part) {
  return {.segment = -1 - part, .T_segment_lidar = T_map_lidar, .origin = -1 - part};
}

Status check_grid(const DescriptorView& place, const DescriptorOptions& grid) {
  if (place.rings == grid.rings && place.sectors == grid.sectors && place.levels == grid.levels) return ok();
  return Error{"the map describes places on a grid of " + std::to_string(place.rings) + " x " +
               std::to_string(place.sectors) + " x " + std::to_string(place.levels) +
               " cells, the parameters on another one: use those that the map was made with"};
}

Status restore_places(const MapStore& store, const StoredMap& map, const DescriptorOptions& grid,
                      const RestorePlace& restore) {
  for (const auto& each : map.keyframes) {
    const auto bytes = store.part(each.frame.frame, MapStore::Part::kDescriptor);
    if (!bytes) return bytes.error();
    if (bytes->empty()) continue;
    const auto descriptor = to_descriptor(*bytes);
    if (!descriptor) return store.damaged("descriptor", each.frame.frame);
    if (Status same = check_grid(*descriptor, grid); !same) return same;
    restore(each, *descriptor);
  }
  return ok();
}

}  // namespace revisit
