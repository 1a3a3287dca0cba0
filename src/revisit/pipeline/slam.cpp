// SPDX-License-Identifier: Apache-2.0
#include <revisit/pipeline/slam.hpp>

#include <sstream>
#include <utility>

#include <revisit/core/stopwatch.hpp>
#include <revisit/core/text.hpp>
#include <revisit/pipeline/known_ground.hpp>
#include <revisit/store/keyframe_bytes.hpp>

namespace revisit {
namespace {

Result<std::shared_ptr<MapStore>> shared(Result<MapStore> store) {
  if (!store) return store.error();
  return std::make_shared<MapStore>(*std::move(store));
}

constexpr const char* kExternalNote = "external_odometry";

}  // namespace

Slam::Slam(const Parameters& parameters, const SlamSetup& setup)
    : Slam(parameters, setup, shared(MapStore::create_temporary())) {}

Slam::Slam(const Parameters& parameters, const SlamSetup& setup, Result<std::shared_ptr<MapStore>> store)
    : parameters_(require_valid(parameters)),
      store_(store ? *store : nullptr),
      failure_(store ? ok() : Status(store.error())),
      front_end_(parameters, setup.odometry, setup.scale, setup.calibration, setup.log),
      back_end_(parameters, setup.odometry, store_, setup.log) {
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
  if (const Status status = back_end_.restore(*map, session); !status) return status;
  if (*removed)
    if (const Status status = back_end_.renumber_parts(*map); !status) return status;
  if (map->keyframes.empty()) return ok();
  if (session_of(map->keyframes.back().frame.frame) != session_) {
    front_end_.begin_session(map->keyframes.back().point.segment + 1);
    return ok();
  }
  const auto last = store_->last_scans(1);
  if (!last) return last.error();
  if (!last->empty()) last_frame_ = in_recording(last->back().frame);
  if (Status restored = front_end_.restore(*store_, *map); !restored) return restored;
  return restore_external();
}

// Wheels go on counting while nobody listens: a run that goes on knows by them how far the robot went meanwhile.
Status Slam::note_external() {
  if (!T_external_last_) return ok();
  const Eigen::Vector3d& p = T_external_last_->translation();
  const Eigen::Quaterniond q(T_external_last_->linear());
  return store_->set_note(kExternalNote, format("%lld %.17g %.17g %.17g %.17g %.17g %.17g %.17g",
                                                static_cast<long long>(in_map(session_, *last_frame_).value), p.x(),
                                                p.y(), p.z(), q.x(), q.y(), q.z(), q.w()));
}

Status Slam::restore_external() {
  const auto note = store_->note(kExternalNote);
  if (!note) return note.error();
  if (!*note || !last_frame_) return ok();
  std::istringstream text(**note);
  long long frame = 0;
  Eigen::Vector3d p;
  Eigen::Quaterniond q;
  text >> frame >> p.x() >> p.y() >> p.z() >> q.x() >> q.y() >> q.z() >> q.w();
  if (!text || FrameId{frame} != in_map(session_, *last_frame_)) return ok();
  Pose T = Pose::Identity();
  T.translation() = p;
  T.linear() = q.normalized().toRotationMatrix();
  if (T.matrix().allFinite()) front_end_.restore_external(T);
  return ok();
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
  T_external_last_ = T_external_lidar;
  if (failure_ && step.is_keyframe) failure_ = note_external();
  if (failure_ && step.is_keyframe) failure_ = store_->commit();
  if (!failure_) return failure_.error();
  step.ms.store += watch.lap_ms();
  return step;
}

Status Slam::add(const GpsFix& fix) {
  if (!failure_) return failure_;
  if (const Status added = back_end_.add_gps(fix); !added) failure_ = added;
  return failure_;
}

Status Slam::finish() {
  if (!failure_) return failure_;
  if (!has_keyframes()) return store_->roll_back();  // an empty session is none
  const Status noted = note_external();
  const Status finished = back_end_.finish();
  return finished ? noted : finished;
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
  return build_map(map_input(), {.voxel_m = parameters_.slam.map_voxel_m}, folder, progress);
}

}  // namespace revisit
