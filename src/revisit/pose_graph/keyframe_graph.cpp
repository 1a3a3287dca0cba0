// SPDX-License-Identifier: Apache-2.0
#include <revisit/pose_graph/keyframe_graph.hpp>

#include <algorithm>
#include <stdexcept>
#include <utility>

#include <revisit/pose_graph/earth.hpp>
#include <revisit/pose_graph/gravity.hpp>

namespace revisit {
namespace {

constexpr std::size_t kSettleEvery_keyframes = 20;  // docs/slam.md, "Loops into the graph"

}  // namespace

void KeyframeGraph::add_keyframe(FrameId frame, const TrajectoryPoint& point, const std::optional<OdometryEdge>& edge,
                                 const std::optional<Pose>& T_world_lidar) {
  if (keyframes_.empty() == edge.has_value())
    throw std::invalid_argument("the first key frame has no edge from the last one, and every other one has");
  gate_.add_keyframe(frame, point);
  const Pose T_by_odometry = edge ? normalised(graph_.nodes().back() * edge->T_last_new) : Pose(Pose::Identity());
  const std::size_t node = graph_.add_node(T_world_lidar ? *T_world_lidar : T_by_odometry);
  if (edge) {
    graph_.add_edge({node - 1, node, edge->T_last_new, edge->information});
    if (point.segment != last_point_.segment) last_attached_ = keyframes_.back();
  }
  node_of_[frame] = node;
  keyframes_.push_back(frame);
  last_point_ = point;
  ++keyframes_unsettled_;
}

// The gate still counts them as apart.
void KeyframeGraph::bring_together(const LoopConstraint& loop) {
  const int match_part = gate_.part(loop.match), query_part = gate_.part(loop.query);
  if (match_part == query_part) return;
  const Pose &T_world_match = T_world_lidar(loop.match), &T_world_query = T_world_lidar(loop.query);
  const Pose T_new_old = query_part > match_part
                             ? T_world_match * loop.T_match_query * T_world_query.inverse()
                             : T_world_query * loop.T_match_query.inverse() * T_world_match.inverse();
  const int moving = std::max(match_part, query_part);
  for (const FrameId frame : keyframes_)
    if (gate_.part(frame) == moving) graph_.move_node(node_of_.at(frame), normalised(T_new_old * T_world_lidar(frame)));
}

bool KeyframeGraph::add_loop(const LoopConstraint& loop) {
  bring_together(loop);
  gate_.join(loop);
  graph_.add_edge({node_of_.at(loop.match), node_of_.at(loop.query), loop.T_match_query, loop.information, true});
  ++loops_unsettled_;
  const bool attaches = last_attached_ && loop.match <= *last_attached_ && *last_attached_ < loop.query;
  if (attaches) last_attached_.reset();
  return attaches;
}

void KeyframeGraph::restore_loop(const LoopConstraint& loop, bool is_placed) {
  if (is_placed) gate_.join(loop);  // nothing is to be moved
  add_loop(loop);
  gate_.restore(loop);
}

Status KeyframeGraph::settle_if_due() {
  return loops_unsettled_ == 0 || keyframes_unsettled_ < kSettleEvery_keyframes ? ok() : optimise(PoseGraph::kOnline);
}

Status KeyframeGraph::settle() { return loops_unsettled_ == 0 ? ok() : optimise(PoseGraph::kExactly); }

Result<std::map<int, Pose>> KeyframeGraph::settle_on_earth(std::span<const Fix> fixes, std::span<const Up> ups) {
  graph_.set_ups({});  // first by odometry and loops alone
  if (const Status settled = optimise(PoseGraph::kExactly); !settled) return settled.error();
  std::vector<EarthFix> of_nodes;
  of_nodes.reserve(fixes.size());
  for (const Fix& fix : fixes)
    if (has(fix.keyframe)) of_nodes.push_back({node_of_.at(fix.keyframe), fix.position_m, fix.deviation_m});
  std::vector<UpReading> readings;
  readings.reserve(ups.size());
  for (const Up& up : ups)  // each session has its accelerometer
    if (has(up.keyframe))
      readings.push_back({node_of_.at(up.keyframe), up.up, session_of(up.keyframe), part(up.keyframe)});
  weigh_ups(graph_, readings);
  graph_.set_ups(std::move(readings));
  std::vector<int> parts;
  parts.reserve(keyframes_.size());
  for (const FrameId frame : keyframes_) parts.push_back(part(frame));
  const auto placed = revisit::settle_on_earth(graph_, of_nodes, parts);
  if (!placed) return placed.error();
  std::map<int, Pose> T_earth_world;
  for (std::size_t part = 0; part < placed->size(); ++part)
    if ((*placed)[part]) T_earth_world[static_cast<int>(part)] = *(*placed)[part];
  return T_earth_world;
}

Status KeyframeGraph::optimise(double settled) {
  const auto report = graph_.optimise(settled);
  if (!report) return report.error();
  loops_unsettled_ = keyframes_unsettled_ = 0;
  return ok();
}

}  // namespace revisit
