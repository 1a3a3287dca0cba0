// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <revisit/core/stopwatch.hpp>
#include <revisit/mapping/build_map.hpp>
#include <revisit/pipeline/slam_back_end.hpp>
#include <revisit/pipeline/slam_front_end.hpp>

namespace revisit {

/// What became of one scan.
struct SlamStep {
  FrameId frame;
  Pose T_world_lidar = Pose::Identity();  ///< as known by now; later loops may move it
  bool is_tracked = true;
  bool is_keyframe = false;
  bool starts_segment = false;         ///< tracking had been lost: a new segment of the trajectory begins here
  std::optional<Detection> detection;  ///< of key frames
  std::size_t loops_entered = 0;       ///< into the graph, with this scan
  struct Milliseconds {
    double odometry = 0.0, prepare = 0.0, detect = 0.0, graph = 0.0, store = 0.0;
  } ms;
};

/// Settings of a Slam beyond the parameters.
struct SlamSetup {
  std::optional<IntensityScale> scale;  ///< without, the first ten key frames decide it
  IntensityCalibration calibration = {};
  Odometry::Source odometry = Odometry::Source::kLidar;
  LogSink log = {};
  std::vector<GpsFix> gps = {};  ///< of the whole recording, by its clock; used where the graph is settled at the end
  bool new_session = false;      ///< another recording enters the map that is there; else its last one goes on
  std::string recording = {};    ///< of a new session, as the map shall name it
  std::string parameters = {};   ///< likewise: what must not change while it is made
  /// How much work a kill may cost: what was found, and what is in memory, is committed so often, or as often as that
  /// takes a twentieth of the time; 0: before every scan.
  double checkpoint_every_s = 2.0;
};

/// Scans in; trajectory, loops and map out, online. Takes scans as a driver delivers them. Everything is kept in a
/// store: a temporary one, or a folder, from which a run that was killed goes on as if it had not been: the same scans
/// give the same map. In memory are the surroundings, the
/// index and the graph. Frames increase. Belongs to one thread at a time.
class Slam {
 public:
  /// Throws std::invalid_argument for parameters out of range.
  explicit Slam(const Parameters& parameters = {}, const SlamSetup& setup = {});
  /// Keeps the map in `folder` (map.revisit), and continues the one that is there, or adds a session to it.
  static Result<Slam> open(const std::filesystem::path& folder, const Parameters& parameters = {},
                           const SlamSetup& setup = {});
  /// The same with a store that was opened already.
  static Result<Slam> open(std::shared_ptr<MapStore> store, const Parameters& parameters, const SlamSetup& setup);

  /// `T_external_lidar`: the pose from wheels or another odometry, in any frame of its own; it may slip and drift.
  /// Stamps that do not increase are replaced, which is logged. An error says why the scan cannot be used; the next one
  /// can, unless the store failed: then every call gives that error, and the folder holds what was committed before.
  Result<SlamStep> process(Scan scan, const std::optional<Pose>& T_external_lidar = std::nullopt);
  /// What a GPS receiver says meanwhile, in the order of the stamps, which are on the scans' clock.
  Status add(const GpsFix& fix);
  /// Decides about loops that wait for others, and settles the graph. More scans may follow.
  Status finish();
  /// A kill from here on costs nothing of what was processed so far.
  Status checkpoint();
  /// Takes over `temporal` and `geometric`, from the next scan on. Throws std::invalid_argument for parameters out of
  /// range.
  void set_verification(const Parameters& parameters) { back_end_.set_verification(require_valid(parameters)); }
  bool has_failed() const { return !failure_; }  ///< the store has

  /// The last one of this session, as its recording numbers it.
  std::optional<FrameId> last_frame() const { return last_frame_; }
  /// Number of this session in the map. Key frames of graph() and store() carry it (in_map()).
  int session() const { return session_; }
  /// Whether this session has any.
  bool has_keyframes() const;
  /// Whether loops join this session with the first one, or whether it waits beside it.
  bool is_joined() const;
  const KeyframeGraph& graph() const { return back_end_.graph(); }
  const MapStore& store() const { return *store_; }

  struct Trajectories {
    Trajectory odometry, corrected;
  };
  /// Of this session, by the frames of its recording.
  Result<Trajectories> trajectories() const;
  /// The map in the world's frame: a point a voxel, without what moved. Intensities in [0, 1]. `progress(done)` counts
  /// key frames and stops the work by returning false: then there are no points.
  Result<std::vector<Point>> map(const std::function<bool(std::size_t)>& progress = {}) const;
  /// The same as files (docs/formats.md), however large.
  Result<MapReport> write_map(const std::filesystem::path& folder,
                              const std::function<bool(std::size_t)>& progress = {}) const;

 private:
  Slam(const Parameters& parameters, const SlamSetup& setup, Result<std::shared_ptr<MapStore>> store);
  Status restore(const SlamSetup& setup);
  Status go_on(const StoredMap& map, const StoredSession& session, const Bytes& state, const SlamSetup& setup);
  MapInput map_input() const;

  Parameters parameters_;
  std::shared_ptr<MapStore> store_;
  Status failure_;  ///< of the store; for good
  SlamFrontEnd front_end_;
  SlamBackEnd back_end_;
  std::optional<FrameId> last_frame_;
  int session_ = 0;
  bool is_finished_ = false;                   ///< and nothing came since
  double checkpoint_every_s_, pause_s_ = 0.0;  ///< between checkpoints: as set, and in fact
  Stopwatch since_checkpoint_;
};

}  // namespace revisit
