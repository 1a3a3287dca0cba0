// SPDX-License-Identifier: Apache-2.0
#include <revisit/store/stored_session.hpp>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <set>
#include <string>

#include <revisit/store/keyframe_bytes.hpp>

namespace revisit {
namespace {

constexpr std::ptrdiff_t kSurroundings_keyframes = 40;  // some 60 m: what odometry can see of its map

Error out_of_order(FrameId keyframe) {
  return {"key frame " + std::to_string(keyframe.value) + " of the map does not follow the one before it"};
}

Result<std::vector<StoredSession::Keyframe>> join(const MapStore& store, const std::vector<StoredKeyframe>& rows,
                                                  const std::vector<StoredEdge>& edges) {
  std::map<FrameId, const StoredEdge*> from_last;
  for (const StoredEdge& edge : edges)
    if (!edge.loop) from_last[edge.to] = &edge;
  std::vector<StoredSession::Keyframe> keyframes;
  for (const StoredKeyframe& row : rows) {
    const auto edge = from_last.find(row.frame);
    if (keyframes.empty() != (edge == from_last.end())) return out_of_order(row.frame);
    if (!keyframes.empty() && edge->second->from != keyframes.back().frame.frame) return out_of_order(row.frame);
    if (!std::isfinite(row.stamp_s) || (keyframes.empty() && row.starts_segment))
      return store.damaged("time or beginning", row.frame);
    StoredSession::Keyframe keyframe{{row.frame, row.stamp_s}, {.T_segment_lidar = row.T_odom_lidar}, std::nullopt};
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

Result<StoredSession> read_session(const MapStore& store) {
  const auto rows = store.keyframes();
  if (!rows) return rows.error();
  const auto edges = store.edges();
  if (!edges) return edges.error();
  auto scans = store.scans();
  if (!scans) return scans.error();
  auto keyframes = join(store, *rows, *edges);
  if (!keyframes) return keyframes.error();
  auto sensor = read_sensor_facts(store);
  if (!sensor) return sensor.error();
  StoredSession session{*std::move(keyframes), {}, *std::move(scans), *std::move(sensor)};
  std::set<FrameId> known;
  for (const auto& each : session.keyframes) known.insert(each.frame.frame);
  for (const StoredEdge& edge : *edges) {
    if (!edge.loop) continue;
    if (edge.from == edge.to || !known.contains(edge.from) || !known.contains(edge.to))
      return Error{"a loop of the map names key frame " + std::to_string(edge.to.value) + ", which it does not have"};
    session.loops.push_back(*edge.loop);
  }
  if (!session.keyframes.empty() && session.scans.empty()) return Error{"the map has key frames but no scans"};
  if (!session.scans.empty() && !std::isfinite(session.scans.back().stamp_s))
    return Error{"the last scan of the map has no time"};
  return session;
}

Status restore_graph(const StoredSession& session, KeyframeGraph& graph) {
  for (const auto& each : session.keyframes) graph.add_keyframe(each.frame.frame, each.point, each.edge);
  for (const LoopConstraint& loop : session.loops) graph.restore_loop(loop);
  return graph.settle();
}

Status restore_places(const MapStore& store, const StoredSession& session, const DescriptorOptions& grid,
                      const RestorePlace& restore) {
  for (const auto& each : session.keyframes) {
    const auto bytes = store.part(each.frame.frame, MapStore::Part::kDescriptor);
    if (!bytes) return bytes.error();
    if (bytes->empty()) continue;
    const auto descriptor = to_descriptor(*bytes);
    if (!descriptor) return store.damaged("descriptor", each.frame.frame);
    if (descriptor->rings != grid.rings || descriptor->sectors != grid.sectors || descriptor->levels != grid.levels)
      return Error{"the map describes places on a grid of " + std::to_string(descriptor->rings) + " x " +
                   std::to_string(descriptor->sectors) + " x " + std::to_string(descriptor->levels) +
                   " cells, the parameters on another one: use those that the map was made with"};
    restore(each.frame, *descriptor, each.point);
  }
  return ok();
}

Status restore_odometry(const MapStore& store, const StoredSession& session, Odometry& odometry,
                        KeyframeSelection& selection) {
  const auto& keyframes = session.keyframes;
  auto first = keyframes.end() - std::min(kSurroundings_keyframes, std::ssize(keyframes));
  // Nothing from before a loss of track: how that lies to what came after is not known.
  const int segment = keyframes.back().point.segment;
  while (first->point.segment != segment) ++first;
  for (auto it = first; it != keyframes.end(); ++it) {
    const auto points = read_map_points(store, it->frame.frame);
    if (!points) return points.error();
    if (!points->empty()) odometry.restore_map(it->frame.stamp_s, *points, it->point.T_segment_lidar);
    if (it + 1 == keyframes.end()) selection.set_last(it->point.T_segment_lidar, SeenSpace(*points));
  }
  const StoredScan& last = session.scans.back();
  std::optional<Twist> motion;
  if (session.scans.size() >= 2) {
    const StoredScan& before = session.scans[session.scans.size() - 2];
    if (const double gap_s = last.stamp_s - before.stamp_s; gap_s > 0.0 && std::isfinite(gap_s))
      motion = twist_of(before.T_odom_lidar.inverse() * last.T_odom_lidar, gap_s);
  }
  odometry.restore(last.stamp_s, last.T_odom_lidar, motion, segment);
  return ok();
}

}  // namespace revisit
