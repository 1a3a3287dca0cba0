// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <revisit/odometry/odometry.hpp>
#include <revisit/pipeline/loop_detector.hpp>
#include <revisit/pose_graph/loop_gate.hpp>
#include <revisit/pose_graph/pose_graph.hpp>
#include <revisit/store/map_store.hpp>

namespace revisit {

/// What became of one scan.
struct SlamStep {
  FrameId frame;
  Pose T_world_lidar = Pose::Identity();  ///< as known by now; later loops may move it
  bool is_tracked = true;
  bool is_keyframe = false;
  bool starts_anew = false;            ///< tracking had been lost: a new piece of trajectory begins here
  std::optional<Detection> detection;  ///< of key frames
  std::size_t loops_entered = 0;       ///< into the graph, with this scan
  struct Milliseconds {
    double odometry = 0.0, prepare = 0.0, detect = 0.0, graph = 0.0, store = 0.0;
  } ms;
};

/// Trajectory and map, online: scans in; poses, key frames and loops out, all of it in a store that survives the end of
/// the program. In memory stay the surroundings, the index and the graph; key frames where a place is known already add
/// to the graph only. Feed frames in increasing order. Belongs to one thread at a time.
class Slam {
 public:
  enum class OdometrySource {
    kLidar,    ///< scans are tracked; a pose that comes with them is a first guess (wheels)
    kExternal  ///< the poses that come with the scans are taken as they are
  };

  /// Goes on where the store ends: an empty one begins a map. Throws std::invalid_argument for parameters out of range;
  /// an error where the store cannot be read.
  static Result<Slam> start(const Parameters& parameters, IntensityScale scale, IntensityCalibration calibration,
                            std::shared_ptr<MapStore> store, OdometrySource source, LogSink log);

  /// `T_odom_lidar`: what wheels or another odometry say, in any frame of their own; they may slip and drift. Stamps
  /// that do not increase are told and taken as a scan later by a tenth of a second. An error says why the scan cannot
  /// be used; the next one can.
  Result<SlamStep> process(Scan scan, const std::optional<Pose>& T_odom_lidar = std::nullopt);
  /// Decides about loops that wait for others, and settles the graph. More scans may follow.
  Status finish();
  /// What wheels said at the last scan of the map that is gone on with.
  void recall_odometry(const Pose& T_odom_lidar);

  std::optional<FrameId> last_frame() const { return last_frame_; }
  const PoseGraph& graph() const { return graph_; }
  const std::vector<FrameId>& keyframes() const { return keyframes_; }  ///< by node of the graph

  struct Trajectories {
    Trajectory odometry, corrected;
  };
  Result<Trajectories> trajectories() const;

 private:
  Slam(const Parameters& parameters, IntensityScale scale, IntensityCalibration calibration,
       std::shared_ptr<MapStore> store, OdometrySource source, LogSink log);
  Status restore();
  Status restore_odometry(const std::vector<StoredKeyframe>& keyframes);

  double monotone_stamp(const Scan& scan);
  std::optional<Pose> prior(const std::optional<Pose>& T_odom_lidar) const;
  OdometryStep track(Scan& scan, double stamp_s, const std::optional<Pose>& T_before_now, std::optional<Twist>& motion);
  void start_again_with(const Twist& motion);
  bool is_keyframe(const OdometryStep& step, const Scan& swept) const;
  Station station_at(const Pose& T_odom_lidar, bool starts_anew) const;
  Status add_keyframe(PreparedScan prepared, const OdometryStep& odometry, bool starts_anew, SlamStep& step);
  Status store(const StoredKeyframe& keyframe, const std::optional<StoredEdge>& edge, const Detection* detection);
  void add_to_graph(const StoredKeyframe& keyframe, const std::optional<StoredEdge>& from_last);
  StoredEdge edge_from_last(const StoredKeyframe& keyframe, const Matrix6& information) const;
  Status enter(const std::vector<LoopGate::Decision>& decisions, SlamStep* step);
  Status settle(bool is_end);

  Parameters parameters_;
  LogSink log_;
  OdometrySource source_;
  std::shared_ptr<MapStore> store_;
  LoopDetector detector_;
  Odometry odometry_;
  LoopGate gate_;
  PoseGraph graph_;

  std::vector<FrameId> keyframes_;
  std::map<FrameId, std::size_t> node_of_;
  std::optional<FrameId> last_frame_;
  double last_stamp_s_ = 0.0;
  std::optional<Pose> T_prior_last_;
  Pose T_odom_at_prior_ = Pose::Identity();  ///< our own, where T_prior_last_ was
  Pose T_odom_last_ = Pose::Identity(), T_odom_keyframe_ = Pose::Identity();
  SeenSpace seen_from_keyframe_;
  std::optional<Scan> first_scan_;  ///< of a piece, as it was swept, until the second one is there
  int untracked_ = 0;               ///< scans in a row
  Station station_;                 ///< of the last key frame
  bool anew_ = false;               ///< the next key frame begins a new piece
  bool is_attached_ = true;         ///< the piece hangs together with those before by a loop
  std::optional<std::pair<FrameId, double>> before_piece_;  ///< the last key frame before it
  std::size_t loops_unsettled_ = 0, keyframes_unsettled_ = 0;
};

}  // namespace revisit
