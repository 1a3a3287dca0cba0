// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <iterator>

#include <revisit/pipeline/keyframe_bytes.hpp>
#include <revisit/pipeline/slam.hpp>

namespace revisit {

Status Slam::restore() {
  const auto keyframes = store_->keyframes();
  if (!keyframes) return keyframes.error();
  if (keyframes->empty()) return ok();
  const auto edges = store_->edges();
  if (!edges) return edges.error();

  std::map<FrameId, const StoredEdge*> from_last;
  for (const StoredEdge& edge : *edges)
    if (!edge.loop) from_last[edge.to] = &edge;
  for (const StoredKeyframe& keyframe : *keyframes) {
    const auto edge = from_last.find(keyframe.frame);
    if (keyframes_.empty() != (edge == from_last.end()))
      return Error{"key frame " + std::to_string(keyframe.frame.value) + " of the map does not hang on the one before"};
    if (!keyframes_.empty() && edge->second->from != keyframes_.back())
      return Error{"key frame " + std::to_string(keyframe.frame.value) + " of the map hangs on key frame " +
                   std::to_string(edge->second->from.value) + ", which is not the one before"};
    if (!std::isfinite(keyframe.stamp_s) || (keyframes_.empty() && keyframe.starts_anew))
      return store_->damaged("time or beginning", keyframe.frame);
    station_ = station_at(keyframe.T_odom_lidar, keyframe.starts_anew);
    gate_.add_keyframe(keyframe.frame, keyframe.T_odom_lidar, keyframe.starts_anew);
    add_to_graph(keyframe, keyframes_.empty() ? std::nullopt : std::optional<StoredEdge>(*edge->second));
    if (keyframe.starts_anew) {
      is_attached_ = false;
      before_piece_ = {keyframes_[keyframes_.size() - 2], keyframe.stamp_s};
    }
    const auto descriptor = store_->part(keyframe.frame, MapStore::Part::kDescriptor);
    if (!descriptor) return descriptor.error();
    if (descriptor->empty()) continue;
    const auto read = to_descriptor(*descriptor);
    if (!read) return store_->damaged("descriptor", keyframe.frame);
    if (read->rings != parameters_.descriptor.rings || read->sectors != parameters_.descriptor.sectors ||
        read->levels != parameters_.descriptor.levels)
      return Error{"the map describes places on a grid of " + std::to_string(read->rings) + " x " +
                   std::to_string(read->sectors) + " x " + std::to_string(read->levels) +
                   " cells, not on the one that is asked for: go on with the parameters it was begun with"};
    detector_.recall(keyframe.frame, keyframe.stamp_s, *read, station_);
  }
  for (const StoredEdge& edge : *edges) {
    if (!edge.loop) continue;
    if (edge.from == edge.to || !node_of_.contains(edge.from) || !node_of_.contains(edge.to))
      return Error{"a loop of the map names key frame " + std::to_string(edge.to.value) + ", which it does not have"};
    graph_.add_edge({node_of_[edge.from], node_of_[edge.to], edge.T_from_to, edge.information, true});
    gate_.restore(*edge.loop);
    if (before_piece_ && before_piece_->first < edge.to && edge.from <= before_piece_->first) is_attached_ = true;
    ++loops_unsettled_;
  }
  if (const Status status = settle(true); !status) return status;
  return restore_odometry(*keyframes);
}

// The surroundings, from the latest key frames that have a cloud; then the motion, from the last two scans.
Status Slam::restore_odometry(const std::vector<StoredKeyframe>& keyframes) {
  const auto scans = store_->scans();
  if (!scans) return scans.error();
  if (scans->empty()) return Error{"the map has key frames but no scans"};
  const StoredScan& last = scans->back();
  if (!std::isfinite(last.stamp_s)) return Error{"the last scan of the map has no time"};
  last_frame_ = last.frame;
  last_stamp_s_ = last.stamp_s;
  T_odom_last_ = last.T_odom_lidar;
  constexpr std::ptrdiff_t kLatest = 40;
  auto first = keyframes.end() - std::min<std::ptrdiff_t>(kLatest, std::ssize(keyframes));
  // Nothing from before a loss of track: odometry does not know how it lies to what came after.
  for (auto it = first; it != keyframes.end(); ++it)
    if (it->starts_anew) first = it;
  for (auto it = first; it != keyframes.end(); ++it) {
    const auto points = read_map_points(*store_, it->frame);
    if (!points) return points.error();
    if (points->empty()) continue;
    OdometryStep step;
    step.T_odom_lidar = it->T_odom_lidar;
    step.is_tracked = true;
    odometry_.accept(it->stamp_s, odometry_.thinned(*points), step);
    if (it + 1 == keyframes.end()) seen_from_keyframe_ = SeenSpace(*points);
  }
  std::optional<Twist> motion;
  if (scans->size() >= 2) {
    const StoredScan& before = (*scans)[scans->size() - 2];
    if (const double gap_s = last.stamp_s - before.stamp_s; gap_s > 0.0 && std::isfinite(gap_s))
      motion = twist_of(before.T_odom_lidar.inverse() * last.T_odom_lidar, gap_s);
  }
  odometry_.stand_at(last.stamp_s, last.T_odom_lidar, motion);
  return ok();
}

}  // namespace revisit
