// SPDX-License-Identifier: Apache-2.0
#include <revisit/pipeline/slam.hpp>

#include <algorithm>
#include <utility>

#include <revisit/core/state_archive.hpp>
#include <revisit/core/text.hpp>
#include <revisit/pipeline/known_ground.hpp>
#include <revisit/pipeline/map_on_earth.hpp>
#include <revisit/store/keyframe_bytes.hpp>

namespace revisit {
namespace {

Result<std::shared_ptr<MapStore>> shared(Result<MapStore> store) {
  if (!store) return store.error();
  return std::make_shared<MapStore>(*std::move(store));
}

constexpr double kCheckpointShare = 0.05;  // of the time, at most

bool is_of_this_version(const Bytes& state) {
  std::string version;
  StateReader reader(state);
  reader(version);
  return version == REVISIT_VERSION;
}

}  // namespace

Slam::Slam(const Parameters& parameters, const SlamSetup& setup)
    : Slam(parameters, setup, shared(MapStore::create_temporary())) {}

Slam::Slam(const Parameters& parameters, const SlamSetup& setup, Result<std::shared_ptr<MapStore>> store)
    : parameters_(require_valid(parameters)),
      store_(store ? *store : nullptr),
      failure_(store ? ok() : Status(store.error())),
      front_end_(parameters, setup.odometry, setup.scale, setup.calibration, setup.log),
      back_end_(parameters, setup.odometry, store_, setup.log),
      checkpoint_every_s_(setup.checkpoint_every_s) {
  back_end_.set_gps(setup.gps);
}

Result<Slam> Slam::open(const std::filesystem::path& folder, const Parameters& parameters, const SlamSetup& setup) {
  std::error_code failure;
  std::filesystem::create_directories(folder, failure);
  if (failure) return Error{folder.string() + ": cannot be created: " + failure.message()};
  const std::filesystem::path file = MapStore::file_of(folder);
  auto store = shared(std::filesystem::exists(file, failure) ? MapStore::open(file) : MapStore::create(file));
  if (!store) return store.error();
  return open(*std::move(store), parameters, setup);
}

Result<Slam> Slam::open(std::shared_ptr<MapStore> store, const Parameters& parameters, const SlamSetup& setup) {
  Slam slam(parameters, setup, std::move(store));
  if (const Status status = slam.restore(setup); !status) return status.error();
  return slam;
}

Status Slam::restore(const SlamSetup& setup) {
  auto map = read_map(*store_);
  if (!map) return map.error();
  // What goes is gone once the new session has a key frame.
  Result<bool> removed = false;
  if (setup.new_session) removed = remove_known_ground(*store_, *map);
  if (!removed) return removed.error();
  if (*removed) map = read_map(*store_);
  if (!map) return map.error();
  StoredSession session{0, setup.recording, setup.parameters, {}};
  const bool continues = !map->sessions.empty() && !setup.new_session;
  if (continues)
    session = map->sessions.back();
  else if (!map->sessions.empty())
    session.id = map->sessions.back().id + 1;
  session_ = session.id;
  if (!continues)
    if (const Status status = store_->set(session); !status) return status;
  if (continues) {
    const auto state = store_->state();
    if (!state) return state.error();
    if (is_of_this_version(*state)) return go_on(*map, session, *state, setup);
  }
  if (const Status status = back_end_.restore(*map, session); !status) return status;
  if (*removed)
    if (const Status status = back_end_.renumber_parts(*map); !status) return status;
  if (map->keyframes.empty()) return ok();
  const StoredMap::Keyframe& last = map->keyframes.back();
  const bool is_same = session_of(last.frame.frame) == session_;
  if (is_same) {
    last_frame_ = in_recording(last.frame.frame);
    log_to(setup.log, LogLevel::kWarning,
           store_->file() +
               ": another version of the program made it, whose memory is gone: a new segment of the "
               "trajectory begins, until its place in the map is found");
  }
  const auto sensor = to_sensor_facts(session.sensor);
  if (!sensor) return sensor.error();
  front_end_.begin_at_segment(last.point.segment + 1, is_same ? *sensor : std::nullopt);
  return ok();
}

// Nothing of the run before is lost but what it logged.
Status Slam::go_on(const StoredMap& map, const StoredSession& session, const Bytes& state, const SlamSetup& setup) {
  StateReader reader(state);
  std::string version;
  reader(version, last_frame_, is_finished_, front_end_);
  if (const Status status = back_end_.restore(map, session, &reader); !status) return status;
  if (!setup.gps.empty()) back_end_.set_gps(setup.gps);
  if (reader.is_complete()) return ok();
  return Error{store_->file() + ": the state of its run does not fit the map: restore the file from a copy"};
}

// The state and all rows that belong to it, at once.
Status Slam::checkpoint() {
  if (!failure_ || !has_keyframes()) return failure_;
  Stopwatch watch;
  StateWriter writer;
  std::string version = REVISIT_VERSION;
  writer(version, last_frame_, is_finished_, front_end_, back_end_);
  failure_ = store_->set_state(writer.take());
  if (failure_) failure_ = store_->commit();
  if (checkpoint_every_s_ > 0.0) pause_s_ = std::max(checkpoint_every_s_, watch.lap_ms() / 1e3 / kCheckpointShare);
  since_checkpoint_.lap_ms();
  return failure_;
}

bool Slam::has_keyframes() const {
  return !graph().keyframes().empty() && session_of(graph().keyframes().back()) == session_;
}

bool Slam::is_joined() const { return has_keyframes() && graph().part(graph().keyframes().back()) == 0; }

Result<SlamStep> Slam::process(Scan scan, const std::optional<Pose>& T_external_lidar) {
  if (!failure_) return failure_.error();
  if (last_frame_ && scan.frame <= *last_frame_)
    return Error{to_text(scan.frame) + ": not after " + to_text(*last_frame_) + ", the last one of the map"};
  if (!fits_into_map(scan.frame))
    return Error{"frame " + std::to_string(scan.frame.value) + ": a map numbers frames from 0 to 2^40 - 1"};
  // Before the scan: by now the caller has dealt with what earlier calls returned.
  if (since_checkpoint_.elapsed_ms() >= 1e3 * pause_s_)
    if (const Status saved = checkpoint(); !saved) return saved.error();
  SlamStep step;
  step.frame = scan.frame;
  scan.frame = in_map(session_, scan.frame);
  auto front = front_end_.step(std::move(scan), T_external_lidar);
  if (!front) return front.error();
  const OdometryStep& odometry = front->odometry;
  step.is_tracked = odometry.is_tracked;
  step.ms.odometry = front->odometry_ms;
  step.ms.prepare = front->prepare_ms;

  if (front->keyframe) {
    const SeenSpace seen = front->keyframe->cloud.seen;
    auto added = back_end_.add_keyframe(*std::move(front->keyframe), odometry, front_end_.sensor());
    if (!added) {
      (void)store_->roll_back();
      failure_ = added.error();
      return failure_.error();
    }
    front_end_.accept_keyframe(odometry, seen);
    step.is_keyframe = true;
    step.starts_segment = front->starts_segment;
    step.detection = std::move(added->detection);
    step.loops_entered = added->loops_entered;
    step.ms.detect = added->detect_ms;
    step.ms.graph = added->graph_ms;
    step.ms.store = added->store_ms;
  }

  Stopwatch watch;
  last_frame_ = step.frame;
  const FrameId keyframe = graph().keyframes().back();
  const Pose T_keyframe_lidar = front_end_.T_keyframe_lidar(odometry);
  step.T_world_lidar = graph().T_world_lidar(keyframe) * T_keyframe_lidar;
  failure_ = store_->add(StoredScan{in_map(session_, step.frame), keyframe, odometry.stamp_s, T_keyframe_lidar,
                                    odometry.T_odom_lidar, step.is_tracked});
  if (!failure_) return failure_.error();
  is_finished_ = false;
  step.ms.store += watch.lap_ms();
  return step;
}

Status Slam::add(const GpsFix& fix) {
  if (!failure_) return failure_;
  is_finished_ = false;
  failure_ = back_end_.add_gps(fix);
  return failure_;
}

Status Slam::finish() {
  if (!failure_) return failure_;
  if (!has_keyframes()) return store_->roll_back();  // an empty session is none
  if (is_finished_) return ok();
  failure_ = back_end_.decide_all();
  if (const Status saved = checkpoint(); !saved) return saved;
  if (const Status settled = back_end_.settle(); !settled) return settled;
  is_finished_ = true;
  return checkpoint();
}

Result<Slam::Trajectories> Slam::trajectories() const {
  const auto scans = store_->scans();
  if (!scans) return scans.error();
  Trajectories result;
  for (const StoredScan& scan : *scans) {
    if (session_of(scan.frame) != session_) continue;
    if (!graph().has(scan.keyframe)) return Error{to_text(scan.frame) + " of the map belongs to no key frame"};
    const FrameId frame = in_recording(scan.frame);
    result.odometry.entries[frame] = {scan.stamp_s, scan.T_odom_lidar};
    result.corrected.entries[frame] = {scan.stamp_s, graph().T_world_lidar(scan.keyframe) * scan.T_keyframe_lidar};
  }
  return result;
}

// Other sessions that are not joined with this one have other coordinates.
MapInput Slam::map_input() const {
  std::vector<FrameId> frames;
  std::vector<Pose> poses;
  std::vector<int> sessions;
  for (const FrameId frame : graph().keyframes()) {
    if (session_of(frame) != session_ && graph().part(frame) != graph().part(graph().keyframes().back())) continue;
    frames.push_back(frame);
    poses.push_back(graph().T_world_lidar(frame));
    sessions.push_back(session_of(frame));
  }
  return {std::move(poses),
          [this, frames = std::move(frames)](std::size_t i) { return read_map_points(*store_, frames[i]); },
          std::move(sessions)};
}

Result<std::vector<Point>> Slam::map(const std::function<bool(std::size_t)>& progress) const {
  return collect_map(map_input(), {.voxel_m = parameters_.slam.map_voxel_m}, progress);
}

Result<MapReport> Slam::write_map(const std::filesystem::path& folder,
                                  const std::function<bool(std::size_t)>& progress) const {
  MapOptions options{.voxel_m = parameters_.slam.map_voxel_m};
  const auto on_earth = MapOnEarth::of(*store_, graph().part(graph().keyframes().back()));
  if (!on_earth) return on_earth.error();
  if (*on_earth) (*on_earth)->place_las(options);
  return build_map(map_input(), options, folder, progress);
}

}  // namespace revisit
