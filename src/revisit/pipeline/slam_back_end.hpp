// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include <revisit/core/gps_fix.hpp>
#include <revisit/odometry/odometry.hpp>
#include <revisit/pipeline/detection.hpp>
#include <revisit/pipeline/keyframe_fixes.hpp>
#include <revisit/pipeline/place_recognition.hpp>
#include <revisit/pose_graph/keyframe_graph.hpp>
#include <revisit/store/sensor_facts.hpp>
#include <revisit/store/stored_map.hpp>

namespace revisit {

/// The half of SLAM that sees key frames: looks for loops, keeps graph and store, and settles the graph.
/// Belongs to one thread at a time.
class SlamBackEnd {
 public:
  SlamBackEnd(const Parameters& parameters, Odometry::Source source, std::shared_ptr<MapStore> store, LogSink log);

  struct Added {
    std::optional<Detection> detection;  ///< absent where the places could not be searched
    std::size_t loops_entered = 0;
    double detect_ms = 0.0, graph_ms = 0.0, store_ms = 0.0;
  };
  /// An error where the store failed: it and the graph are then no longer the same.
  Result<Added> add_keyframe(PreparedScan scan, const OdometryStep& odometry, const SensorFacts& sensor);
  /// What a receiver said meanwhile, in the order of its times, by the recording's clock.
  void set_gps(std::vector<GpsFix> fixes) { fixes_.set(std::move(fixes)); }
  /// The next one of a receiver at work.
  Status add_gps(const GpsFix& fix);
  /// A key frame of another map enters this one, and is looked for among the first `places` of it.
  struct Entry {
    StoredKeyframe row;  ///< the bytes of `place` need not be there
    TrajectoryPoint point;
    std::optional<KeyframeGraph::OdometryEdge> edge;  ///< from the key frame before; absent for the first of all
    std::optional<Pose> T_world_lidar = {};           ///< where it is known
    std::optional<PreparedScan> place = {};           ///< absent where the place was known
  };
  Result<Added> add_entry(Entry entry, std::size_t places);
  /// A loop that another map holds, between key frames that entered this one.
  Status add_known_loop(const LoopConstraint& loop);
  /// What follows belongs to this session: after the first, decides about all loops that wait.
  Status begin_session(const StoredSession& session);
  /// Decides about loops that wait for others: no more will come.
  Status decide_all();
  /// Settles the graph, and makes the map ready to be opened. All of it is stored, or none.
  Status settle();
  /// The map of before; `session` is the one that this run adds or continues. `state`: what archive() wrote of the run
  /// that goes on.
  Status restore(const StoredMap& map, const StoredSession& session, StateReader* state = nullptr);
  void archive(auto& fields) {
    fields(fixes_, last_up_s_, session_.sensor, facts_, graph_, recognition_, newest_session_, stamp_shift_s_,
           newest_stamp_s_);
  }

  /// Parts are counted by their segments: once some have gone, what the map says of its parts is written anew.
  Status renumber_parts(const StoredMap& map);

  void set_verification(const Parameters& parameters) { recognition_.set_verification(parameters); }

  const KeyframeGraph& graph() const { return graph_; }
  std::size_t places() const { return recognition_.index().size(); }

 private:
  bool starts_segment(const TrajectoryPoint& point) const;
  Result<Detection> find_loop(const PreparedScan& keyframe, const SensorFacts& sensor);
  KeyframeGraph::OdometryEdge edge_to(const TrajectoryPoint& point, const Matrix6& information) const;
  Status write_map_poses();
  Status set_map_poses();
  Status add_fix(FrameId keyframe, double stamp_s);
  Status add_up(FrameId keyframe, double stamp_s, const Eigen::Vector3f& up);
  std::vector<StoredMapPose> poses_of_places() const;
  Status learn_look_alikes();
  Status settle_session();
  Status enter_keyframe(Entry entry, Result<Detection> detection, Added& added);
  Status enter(const std::vector<LoopGate::Decision>& decisions, std::size_t& entered);

  FrameTime time_in_index(const FrameTime& frame);

  KeyframeFixes fixes_;
  std::optional<double> last_up_s_;  ///< when the last reading of gravity was kept
  StoredSession session_;
  SensorFacts facts_;  ///< of this session
  Parameters parameters_;
  Odometry::Source source_;
  std::shared_ptr<MapStore> store_;
  LogSink log_;
  PlaceRecognition recognition_;
  KeyframeGraph graph_;
  // Sessions have clocks of their own: in the index each begins long after the one before.
  int newest_session_ = -1;
  double stamp_shift_s_ = 0.0, newest_stamp_s_ = 0.0;
};

}  // namespace revisit
