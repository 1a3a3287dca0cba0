// SPDX-License-Identifier: Apache-2.0
#include <revisit/pipeline/slam.hpp>

#include <cmath>

#include <revisit/pipeline/edge_information.hpp>
#include <revisit/pipeline/keyframe_bytes.hpp>
#include <revisit/pipeline/stored_clouds.hpp>
#include <revisit/preprocess/range_filter.hpp>
#include <revisit/preprocess/undistort.hpp>

namespace revisit {
namespace {

constexpr int kLostAfter_scans = 5;
constexpr double kLongestSweep_s = 1.0;  // between two scans; beyond, their motion tells nothing about a sweep

std::string frame_text(FrameId frame) { return "frame " + std::to_string(frame.value); }

}  // namespace

Slam::Slam(const Parameters& parameters, IntensityScale scale, IntensityCalibration calibration,
           std::shared_ptr<MapStore> store, OdometrySource source, LogSink log)
    : parameters_(parameters),
      log_(log),
      source_(source),
      store_(std::move(store)),
      detector_(parameters, std::move(scale), std::move(calibration), std::move(log), clouds_in_store(store_)) {}

Result<Slam> Slam::start(const Parameters& parameters, IntensityScale scale, IntensityCalibration calibration,
                         std::shared_ptr<MapStore> store, OdometrySource source, LogSink log) {
  Slam slam(parameters, std::move(scale), std::move(calibration), std::move(store), source, std::move(log));
  if (const Status status = slam.restore(); !status) return status.error();
  return slam;
}

Result<SlamStep> Slam::process(Scan scan, const std::optional<Pose>& T_odom_lidar) {
  SlamStep step;
  step.frame = scan.frame;
  filter_range(scan, parameters_.preprocess);
  if (scan.points.empty())
    return Error{frame_text(scan.frame) + ": no point between " + std::to_string(parameters_.preprocess.min_range_m) +
                 " and " + std::to_string(parameters_.preprocess.max_range_m) + " m"};
  Stopwatch watch;
  const double stamp_s = monotone_stamp(scan);
  const bool starts_anew = anew_ && !keyframes_.empty();
  Scan swept = scan;
  std::optional<Twist> motion;
  const OdometryStep odometry = track(swept, stamp_s, prior(T_odom_lidar), motion);
  step.ms.odometry = watch.lap_ms();

  last_frame_ = scan.frame;
  last_stamp_s_ = stamp_s;
  T_odom_last_ = odometry.T_odom_lidar;
  if (T_odom_lidar) recall_odometry(*T_odom_lidar);
  step.is_tracked = odometry.is_tracked;

  // Until it is known how well intensities agree with this sensor, every scan is looked at for that.
  const bool keyframe = starts_anew || keyframes_.empty() || (odometry.is_tracked && is_keyframe(odometry, swept));
  if (keyframe || !detector_.knows_intensities()) {
    scan.stamp_s = stamp_s;
    auto prepared = detector_.prepare(std::move(scan), motion);
    if (prepared && !detector_.knows_intensities()) detector_.learn_intensities(*prepared);
    step.ms.prepare = watch.lap_ms();
    if (!prepared && keyframes_.empty()) return prepared.error();
    if (prepared && keyframe)
      if (const Status status = add_keyframe(*std::move(prepared), odometry, starts_anew, step); !status)
        return status.error();
    watch.lap_ms();
  }
  const Pose T_keyframe_lidar = T_odom_keyframe_.inverse() * odometry.T_odom_lidar;
  step.T_world_lidar = graph_.nodes().back() * T_keyframe_lidar;
  if (const Status status = store_->add(StoredScan{step.frame, keyframes_.back(), stamp_s, T_keyframe_lidar,
                                                   odometry.T_odom_lidar, odometry.is_tracked});
      !status)
    return status.error();
  if (step.is_keyframe)
    if (const Status status = store_->commit(); !status) return status.error();
  step.ms.store += watch.lap_ms();
  return step;
}

void Slam::recall_odometry(const Pose& T_odom_lidar) {
  T_prior_last_ = T_odom_lidar;
  T_odom_at_prior_ = T_odom_last_;
}

double Slam::monotone_stamp(const Scan& scan) {
  constexpr double kUsualPeriod_s = 0.1;
  if (!last_frame_ || scan.stamp_s > last_stamp_s_) return scan.stamp_s;
  log_to(
      log_, LogLevel::kWarning,
      frame_text(scan.frame) + ": its stamp is not after that of the scan before; taken as a tenth of a second after");
  return last_stamp_s_ + kUsualPeriod_s;
}

std::optional<Pose> Slam::prior(const std::optional<Pose>& T_odom_lidar) const {
  if (!T_odom_lidar || !T_prior_last_) return std::nullopt;
  // Since the scan before, which may have come without: from the last one that had it.
  return T_odom_last_.inverse() * T_odom_at_prior_ * (T_prior_last_->inverse() * *T_odom_lidar);
}

OdometryStep Slam::track(Scan& scan, double stamp_s, const std::optional<Pose>& T_before_now,
                         std::optional<Twist>& motion) {
  const double gap_s = stamp_s - last_stamp_s_;
  const bool follows = last_frame_.has_value() && gap_s <= kLongestSweep_s;
  if (source_ == OdometrySource::kExternal) {
    OdometryStep step;
    step.is_tracked = T_before_now.has_value() || !last_frame_;
    if (T_before_now) step.T_before_now = *T_before_now;
    step.T_odom_lidar = T_odom_last_ * step.T_before_now;
    if (follows) motion = twist_of(step.T_before_now, gap_s);
    return step;
  }
  const bool is_swept = !scan.times_s.empty() && follows;
  motion = T_before_now && follows ? twist_of(*T_before_now, gap_s) : odometry_.expected(stamp_s);
  const Scan raw = is_swept ? scan : Scan{};
  if (motion && is_swept) {
    undistort(scan, *motion);
    if (first_scan_) start_again_with(*motion);
  }
  OdometryScan thinned = odometry_.thinned(scan.points);
  OdometryStep step = odometry_.find(stamp_s, thinned, T_before_now);
  // Points stand where the motion had them that was expected: where it was another, once more with that.
  constexpr double kWrong_m = 0.1;
  if (is_swept && step.surprise_m > kWrong_m) {
    const Twist found = twist_of(step.T_before_found, gap_s);
    Scan swept_so = raw;
    undistort(swept_so, found);
    if (first_scan_) start_again_with(found);
    OdometryScan thinned_so = odometry_.thinned(swept_so.points);
    const OdometryStep so = odometry_.find(stamp_s, thinned_so, step.T_before_found);
    if (so.is_tracked) {
      step = so;
      motion = found;
      scan = std::move(swept_so);
      thinned = std::move(thinned_so);
    }
  }
  first_scan_.reset();
  if (!odometry_.map() && !motion) first_scan_ = scan;
  odometry_.accept(stamp_s, thinned, step);
  untracked_ = step.is_tracked ? 0 : untracked_ + 1;
  if (untracked_ >= kLostAfter_scans) {
    anew_ = true;
    log_to(log_, LogLevel::kWarning,
           frame_text(scan.frame) + ": tracking is lost since " + std::to_string(untracked_) +
               " scans; a new piece of trajectory begins, until its place in the map is found");
    odometry_.restart();
    untracked_ = 0;
  }
  return step;
}

// The first scan went into the map as it was swept: now that the motion is known, it goes in as it was seen.
void Slam::start_again_with(const Twist& motion) {
  undistort(*first_scan_, motion);
  OdometryStep first;
  first.T_odom_lidar = T_odom_last_;
  first.is_tracked = true;
  odometry_.restart();
  odometry_.accept(last_stamp_s_, odometry_.thinned(first_scan_->points), first);
  first_scan_.reset();
}

bool Slam::is_keyframe(const OdometryStep& step, const Scan& swept) const {
  const Pose T_keyframe_lidar = T_odom_keyframe_.inverse() * step.T_odom_lidar;
  if (T_keyframe_lidar.translation().norm() >= parameters_.slam.keyframe_distance_m ||
      to_degrees(rotation_angle(T_keyframe_lidar)) >= parameters_.slam.keyframe_angle_deg)
    return true;
  // Round a corner, or through a door: what is in view now was hidden from there.
  constexpr std::size_t kSamples = 2000;
  constexpr float kMargin_m = 1.f;
  const Eigen::Isometry3f T = T_keyframe_lidar.cast<float>();
  const std::size_t stride = std::max<std::size_t>(1, swept.points.size() / kSamples);
  std::size_t looked = 0, in_view = 0;
  for (std::size_t i = 0; i < swept.points.size(); i += stride) {
    const Point& p = swept.points[i];
    const auto verdict = seen_from_keyframe_.look(T * Eigen::Vector3f(p.x, p.y, p.z), kMargin_m);
    ++looked;
    in_view += verdict == SeenSpace::Verdict::kSurface;
  }
  return static_cast<double>(in_view) < parameters_.slam.keyframe_overlap * static_cast<double>(looked);
}

Station Slam::station_at(const Pose& T_odom_lidar, bool starts_anew) const {
  if (keyframes_.empty() || starts_anew) return {.piece = station_.piece + 1, .T_piece_lidar = T_odom_lidar};
  return station_.after(station_.T_piece_lidar.inverse() * T_odom_lidar);
}

Status Slam::add_keyframe(PreparedScan prepared, const OdometryStep& odometry, bool starts_anew, SlamStep& step) {
  Stopwatch watch;
  if (starts_anew) {
    is_attached_ = false;
    before_piece_ = {keyframes_.back(), last_stamp_s_};
  }
  const Station station = station_at(odometry.T_odom_lidar, starts_anew);
  prepared.station = station;
  // What cannot be read back from the store is no loop; the key frame is one all the same.
  auto detection = detector_.detect(prepared, std::nullopt, {false, is_attached_ ? std::nullopt : before_piece_});
  if (!detection)
    log_to(log_, LogLevel::kWarning, frame_text(step.frame) + ": no loop is looked for: " + detection.error().message);
  step.ms.detect = watch.lap_ms();

  StoredKeyframe keyframe{prepared.scan.frame, prepared.scan.stamp_s, odometry.T_odom_lidar, starts_anew, {}, {}, {}};
  gate_.add_keyframe(keyframe.frame, keyframe.T_odom_lidar, starts_anew);
  std::vector<LoopGate::Decision> decisions;
  bool is_known_place = false;
  if (detection && detection->loop) {
    decisions = gate_.offer({*detection->loop, detection->score});
    // A place that is known is not learnt again: memory stays as it is on known ground.
    constexpr double kSamePlace_m = 1.0, kSameHeading_rad = 0.35;
    const Pose& T = detection->loop->T_match_query;
    is_known_place =
        !decisions.empty() && T.translation().norm() < kSamePlace_m && rotation_angle(T) < kSameHeading_rad;
  }
  for (LoopGate::Decision& decision : gate_.decide_waiting(false)) decisions.push_back(std::move(decision));

  if (!is_known_place) {
    keyframe.descriptor = to_bytes(prepared.descriptor);
    keyframe.place = to_bytes(prepared.cloud);
    keyframe.cloud =
        to_map_bytes(thin_surfaces(prepared.scan.points, prepared.ground.is_ground, parameters_.slam.map_voxel_m));
  }
  std::optional<StoredEdge> edge;
  if (!keyframes_.empty()) edge = edge_from_last(keyframe, odometry.information);
  if (const Status status = store(keyframe, edge, detection ? &*detection : nullptr); !status) return status;
  step.ms.store = watch.lap_ms();

  // From here on memory and store say the same.
  step.is_keyframe = true;
  step.starts_anew = starts_anew;
  station_ = station;
  if (starts_anew || keyframes_.empty()) anew_ = false;  // before the first there is nothing to be lost from
  add_to_graph(keyframe, edge);
  seen_from_keyframe_ = prepared.cloud.seen;
  if (!is_known_place)
    if (const Status status = detector_.remember(std::move(prepared), std::nullopt); !status) return status;
  if (detection) step.detection = *std::move(detection);
  const Status entered = enter(decisions, &step);
  if (const Status settled = settle(false); !settled) log_to(log_, LogLevel::kWarning, settled.error().message);
  step.ms.graph = watch.lap_ms();
  return entered;
}

// All of it or nothing.
Status Slam::store(const StoredKeyframe& keyframe, const std::optional<StoredEdge>& edge, const Detection* detection) {
  Status status = store_->add(keyframe);
  if (status && edge) status = store_->add(*edge);
  if (status && detection != nullptr && detection->newest_searchable) status = store_->add(detection->row());
  if (!status) (void)store_->take_back();
  return status;
}

StoredEdge Slam::edge_from_last(const StoredKeyframe& keyframe, const Matrix6& information) const {
  StoredEdge edge{keyframes_.back(), keyframe.frame, T_odom_keyframe_.inverse() * keyframe.T_odom_lidar, {}, {}};
  edge.information = keyframe.starts_anew                   ? no_information()
                     : source_ == OdometrySource::kExternal ? external_odometry_information(edge.T_from_to)
                                                            : odometry_information(edge.T_from_to, information);
  return edge;
}

void Slam::add_to_graph(const StoredKeyframe& keyframe, const std::optional<StoredEdge>& from_last) {
  const Pose T_world =
      from_last ? graph_.nodes().back() * from_last->T_from_to : Pose(Pose::Identity());  // the first is the origin
  const std::size_t node = graph_.add_node(T_world);
  if (from_last) graph_.add_edge({node - 1, node, from_last->T_from_to, from_last->information});
  node_of_[keyframe.frame] = node;
  keyframes_.push_back(keyframe.frame);
  T_odom_keyframe_ = keyframe.T_odom_lidar;
  ++keyframes_unsettled_;
}

Status Slam::enter(const std::vector<LoopGate::Decision>& decisions, SlamStep* step) {
  Status result = ok();
  for (const LoopGate::Decision& decision : decisions) {
    const LoopConstraint& loop = decision.loop.constraint;
    if (!decision.enters) {
      log_to(log_, LogLevel::kInfo,
             "the loop from " + frame_text(loop.query) + " to " + std::to_string(loop.match.value) +
                 " stays out of the graph: no other one agrees with it");
      continue;
    }
    StoredEdge edge{loop.match, loop.query, loop.T_match_query, loop_information(loop.information), decision.loop};
    edge.loop->constraint.information = edge.information;
    graph_.add_edge({node_of_.at(edge.from), node_of_.at(edge.to), edge.T_from_to, edge.information, true});
    if (const Status status = store_->add(edge); !status && result) result = status;
    ++loops_unsettled_;
    if (step != nullptr) ++step->loops_entered;
    if (!is_attached_ && before_piece_ && before_piece_->first < loop.query) {
      is_attached_ = true;
      log_to(log_, LogLevel::kInfo,
             frame_text(loop.query) + ": found again in the map, at frame " + std::to_string(loop.match.value));
    }
  }
  return result;
}

Status Slam::settle(bool is_end) {
  constexpr std::size_t kEvery_keyframes = 20;
  if (loops_unsettled_ == 0 || (!is_end && keyframes_unsettled_ < kEvery_keyframes)) return ok();
  const auto report = graph_.optimise(is_end ? PoseGraph::kExactly : PoseGraph::kOnline);
  if (!report) return report.error();
  loops_unsettled_ = keyframes_unsettled_ = 0;
  return ok();
}

Status Slam::finish() {
  if (keyframes_.empty()) return ok();
  const Status entered = enter(gate_.decide_waiting(true), nullptr);
  const Status settled = settle(true), committed = store_->commit();
  for (const Status* each : {&entered, &settled})
    if (!*each) return *each;
  return committed;
}

Result<Slam::Trajectories> Slam::trajectories() const {
  const auto scans = store_->scans();
  if (!scans) return scans.error();
  Trajectories result;
  for (const StoredScan& scan : *scans) {
    const auto node = node_of_.find(scan.keyframe);
    if (node == node_of_.end()) return Error{frame_text(scan.frame) + " of the map hangs on no key frame"};
    result.odometry.entries[scan.frame] = {scan.stamp_s, scan.T_odom_lidar};
    result.corrected.entries[scan.frame] = {scan.stamp_s, graph_.nodes()[node->second] * scan.T_keyframe_lidar};
  }
  return result;
}

}  // namespace revisit
