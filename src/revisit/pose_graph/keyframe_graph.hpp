// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <optional>
#include <span>
#include <vector>

#include <revisit/core/loop.hpp>
#include <revisit/core/trajectory_point.hpp>
#include <revisit/pose_graph/loop_gate.hpp>
#include <revisit/pose_graph/pose_graph.hpp>

namespace revisit {

/// The back end of SLAM: key frames joined by odometry and by the loops that the gate lets in, and where they stand in
/// the world. Knows neither scans nor files. Belongs to one thread at a time.
class KeyframeGraph {
 public:
  /// The motion since the last key frame.
  struct OdometryEdge {
    Pose T_last_new = Pose::Identity();
    Matrix6 information = Matrix6::Identity();
  };
  /// The first key frame is the origin of the world; every later one has an edge. A point on another segment than the
  /// last one's begins a segment that is not yet attached to the map. `T_world_lidar`: where it is, if that is known.
  void add_keyframe(FrameId frame, const TrajectoryPoint& point, const std::optional<OdometryEdge>& edge,
                    const std::optional<Pose>& T_world_lidar = std::nullopt);

  /// Hands a loop between two key frames, of which the query may be the newest of all, to the gate.
  std::vector<LoopGate::Decision> offer(const LoopConstraint& loop) { return gate_.offer(loop); }
  std::vector<LoopGate::Decision> decide_overdue() { return gate_.decide_overdue(); }
  std::vector<LoopGate::Decision> decide_all() { return gate_.decide_all(); }
  /// Adds a loop that the gate let in. True where it attaches the newest segment to the map. Of two parts that it
  /// joins, the later one moves to where the loop has it.
  bool add_loop(const LoopConstraint& loop);
  /// A loop that entered in an earlier run; `is_placed`: the key frames are where it has them.
  void restore_loop(const LoopConstraint& loop, bool is_placed);
  /// All key frames are where the loops have them.
  void set_settled() { loops_unsettled_ = keyframes_unsettled_ = 0; }

  /// Moves the key frames to where all edges agree best: at the latest after 20 key frames with loops among them.
  Status settle_if_due();
  /// The same at once, and to the last digit.
  Status settle();

  struct Fix {
    FrameId keyframe;
    Eigen::Vector3d position_m = Eigen::Vector3d::Zero(), deviation_m = Eigen::Vector3d::Ones();
  };
  struct Up {
    FrameId keyframe;
    Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
  };
  /// The same as settle(), with these (EarthFix, UpReading): for each part that fixes place, T_earth_world.
  Result<std::map<int, Pose>> settle_on_earth(std::span<const Fix> fixes, std::span<const Up> ups);

  bool has(FrameId frame) const { return node_of_.contains(frame); }
  const Pose& T_world_lidar(FrameId keyframe) const { return graph_.nodes()[node_of_.at(keyframe)]; }
  const std::vector<FrameId>& keyframes() const { return keyframes_; }  ///< by node of the graph
  bool is_settled() const { return loops_unsettled_ == 0; }
  /// Which part of the map a key frame is in: between parts there is no loop, and their coordinates are not related.
  /// The number is that of the part's first segment.
  int part(FrameId keyframe) const { return gate_.part(keyframe); }
  const PoseGraph& graph() const { return graph_; }
  const TrajectoryPoint& last_point() const { return last_point_; }
  /// While the newest segment is not attached: the last key frame before it.
  std::optional<FrameId> last_attached() const { return last_attached_; }
  void archive(auto& fields) {
    fields(graph_, gate_, keyframes_, last_point_, last_attached_, loops_unsettled_, keyframes_unsettled_);
    node_of_.clear();
    for (std::size_t node = 0; node < keyframes_.size(); ++node) node_of_[keyframes_[node]] = node;
    fields.require(keyframes_.size() == graph_.nodes().size() && node_of_.size() == keyframes_.size() &&
                   gate_.keyframes() == keyframes_.size());
    for (const FrameId frame : keyframes_) fields.require(gate_.has(frame));
    fields.require(!last_attached_ || has(*last_attached_));
  }

 private:
  Status optimise(double settled);
  void bring_together(const LoopConstraint& loop);

  PoseGraph graph_;
  LoopGate gate_;
  std::vector<FrameId> keyframes_;
  std::map<FrameId, std::size_t> node_of_;
  TrajectoryPoint last_point_;
  std::optional<FrameId> last_attached_;
  std::size_t loops_unsettled_ = 0, keyframes_unsettled_ = 0;
};

}  // namespace revisit
