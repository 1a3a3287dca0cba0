// SPDX-License-Identifier: Apache-2.0
#include <revisit/pipeline/slam_back_end.hpp>

#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <utility>

#include <oneapi/tbb/parallel_invoke.h>

#include <revisit/core/stopwatch.hpp>
#include <revisit/core/text.hpp>
#include <revisit/pipeline/settle_map.hpp>
#include <revisit/pipeline/visits.hpp>
#include <revisit/pose_graph/edge_information.hpp>
#include <revisit/store/keyframe_bytes.hpp>
#include <revisit/store/stored_clouds.hpp>

namespace revisit {
namespace {

// A key frame so near to a place that it was recognised as adds a node to the graph, but no place and no cloud: memory
// stays as it is on known ground.
constexpr double kKnownPlace_m = 1.0, kKnownPlace_deg = 20.0;

bool is_near(const Pose& T) {
  return T.translation().norm() < kKnownPlace_m && rotation_angle(T) < to_radians(kKnownPlace_deg);
}

}  // namespace

SlamBackEnd::SlamBackEnd(const Parameters& parameters, Odometry::Source source, std::shared_ptr<MapStore> store,
                         LogSink log)
    : parameters_(parameters),
      source_(source),
      store_(std::move(store)),
      log_(std::move(log)),
      recognition_(parameters, clouds_in_store(store_)) {
  recognition_.expect_one_drive();
}

Result<SlamBackEnd::Added> SlamBackEnd::add_keyframe(PreparedScan scan, const OdometryStep& odometry,
                                                     const SensorFacts& sensor) {
  Stopwatch watch;
  Added added;
  const FrameId frame = scan.scan.frame;
  const bool is_first = graph_.keyframes().empty();
  const bool is_new_segment = is_first || odometry.segment != graph_.last_point().segment;
  const TrajectoryPoint point = is_new_segment ? TrajectoryPoint{.segment = odometry.segment,
                                                                 .T_segment_lidar = odometry.T_odom_lidar,
                                                                 .origin = odometry.segment}
                                               : graph_.last_point().to(odometry.T_odom_lidar);
  const bool starts = starts_segment(point);
  scan.trajectory_point = point;
  const double stamp_s = scan.scan.stamp_s;
  scan.scan.stamp_s = time_in_index({frame, stamp_s}).stamp_s;
  // The cloud is thinned for the map meanwhile, for nothing where the place turns out to be known.
  Result<Detection> detection = Error{};
  Bytes map_cloud;
  tbb::parallel_invoke(
      [&] { detection = find_loop(scan, sensor); },
      [&] {
        map_cloud = to_map_bytes(thin_surfaces(scan.scan.points, scan.ground.is_ground, parameters_.slam.map_voxel_m));
      });
  added.detect_ms = watch.lap_ms();

  facts_ = sensor;
  Entry entry{{frame, stamp_s, odometry.T_odom_lidar, starts, {}, {}, std::move(map_cloud)}, point, std::nullopt};
  if (!is_first) entry.edge = edge_to(point, odometry.information);
  entry.place = std::move(scan);
  if (const Status entered = enter_keyframe(std::move(entry), std::move(detection), added); !entered)
    return entered.error();
  if (const Status fixed = add_fix(frame, stamp_s); !fixed) return fixed.error();
  if (odometry.up_by_gravity)
    if (const Status added_up = add_up(frame, stamp_s, *odometry.up_by_gravity); !added_up) return added_up.error();
  return added;
}

Status SlamBackEnd::enter_keyframe(Entry entry, Result<Detection> detection, Added& added) {
  Stopwatch watch;
  const FrameId frame = entry.row.frame;
  std::optional<StoredEdge> edge;
  if (entry.edge)
    edge = StoredEdge{graph_.keyframes().back(), frame, entry.edge->T_last_new, entry.edge->information, {}};
  graph_.add_keyframe(frame, entry.point, entry.edge, entry.T_world_lidar);
  std::vector<LoopGate::Decision> decisions;
  bool is_known_place = !entry.place;
  if (detection && detection->loop) {
    decisions = graph_.offer(*detection->loop);
    is_known_place = is_known_place || (!decisions.empty() && is_near(detection->loop->T_match_query));
  }
  for (LoopGate::Decision& decision : graph_.decide_overdue()) decisions.push_back(std::move(decision));
  added.graph_ms += watch.lap_ms();

  StoredKeyframe& row = entry.row;
  Bytes visit;
  if (is_known_place) {
    if (session_.id > 0) visit = std::move(row.cloud);
    row.descriptor = row.place = row.cloud = {};
  } else if (row.descriptor.empty()) {
    row.descriptor = to_bytes(entry.place->descriptor);
    row.place = to_bytes(entry.place->cloud);
  }
  Status stored = store_->add(row);
  if (stored && !visit.empty()) stored = store_->add_visit(frame, visit);
  if (stored && edge) stored = store_->add(*edge);
  if (stored && detection && detection->searchable_places > 0) stored = store_->add(detection->row());
  if (std::string facts = to_text(facts_); stored && facts != session_.sensor) {
    session_.sensor = std::move(facts);
    stored = store_->set(session_);
  }
  if (stored) stored = enter(decisions, added.loops_entered);
  if (stored && !is_known_place) stored = recognition_.add(*std::move(entry.place));
  if (!stored) return stored;
  added.store_ms += watch.lap_ms();

  if (const Status settled = graph_.settle_if_due(); !settled)
    log_to(log_, LogLevel::kWarning, settled.error().message);
  if (detection) added.detection = *std::move(detection);
  added.graph_ms += watch.lap_ms();
  return ok();
}

Result<SlamBackEnd::Added> SlamBackEnd::add_entry(Entry entry, std::size_t places) {
  Added added;
  Result<Detection> detection = Error{};
  if (entry.place) {
    entry.place->trajectory_point = entry.point;
    entry.place->scan.frame = entry.row.frame;
    entry.place->scan.stamp_s = time_in_index({entry.row.frame, entry.row.stamp_s}).stamp_s;
    if (places > 0) detection = recognition_.find(*entry.place, places, facts_.typical);
  }
  if (const Status entered = enter_keyframe(std::move(entry), std::move(detection), added); !entered)
    return entered.error();
  return added;
}

Status SlamBackEnd::add_known_loop(const LoopConstraint& loop) {
  graph_.restore_loop(loop, true);
  return store_->add(StoredEdge{loop.match, loop.query, loop.T_match_query, loop.information, loop});
}

Status SlamBackEnd::begin_session(const StoredSession& session) {
  if (!graph_.keyframes().empty())
    if (const Status status = settle_session(); !status) return status;
  session_ = session;
  const auto facts = to_sensor_facts(session.sensor);
  if (!facts) return facts.error();
  facts_ = facts->value_or(SensorFacts{});
  return store_->set(session_);
}

// Tracking was lost before this key frame: how it lies to the one before is not known.
bool SlamBackEnd::starts_segment(const TrajectoryPoint& point) const {
  return !graph_.keyframes().empty() && point.segment != graph_.last_point().segment;
}

// A segment that is not attached yet is looked for in everything that was mapped before it, however recent.
Result<Detection> SlamBackEnd::find_loop(const PreparedScan& keyframe, const SensorFacts& sensor) {
  const auto last_attached =
      starts_segment(*keyframe.trajectory_point) ? std::optional(graph_.keyframes().back()) : graph_.last_attached();
  const PlaceIndex& index = recognition_.index();
  const FrameTime frame{keyframe.scan.frame, keyframe.scan.stamp_s};
  const std::size_t old_enough = index.searchable(frame);
  const std::size_t places = last_attached ? std::max(index.until(*last_attached), old_enough) : old_enough;
  auto detection = recognition_.find(keyframe, places, sensor.typical);
  // A place that cannot be read gives no loop; the key frame is one all the same.
  if (!detection)
    log_to(log_, LogLevel::kWarning, to_text(frame.frame) + ": no loop is searched: " + detection.error().message);
  return detection;
}

KeyframeGraph::OdometryEdge SlamBackEnd::edge_to(const TrajectoryPoint& point, const Matrix6& information) const {
  const TrajectoryPoint& last = graph_.last_point();
  const Pose T_last_new = T_between(last, point);
  if (point.segment != last.segment) return {T_last_new, no_information()};
  return {T_last_new, source_ == Odometry::Source::kExternal ? external_odometry_information(T_last_new)
                                                             : odometry_information(T_last_new, information)};
}

Status SlamBackEnd::enter(const std::vector<LoopGate::Decision>& decisions, std::size_t& entered) {
  for (const LoopGate::Decision& decision : decisions) {
    LoopConstraint loop = decision.loop;
    if (!decision.enters) {
      log_to(log_, LogLevel::kInfo,
             "the loop from " + to_text(loop.query) + " to " + to_text(loop.match) +
                 " stays out of the graph: no other one agrees with it, or one that entered contradicts it");
      continue;
    }
    loop.information = loop_information(loop.information);
    const bool attaches = graph_.add_loop(loop);
    ++entered;
    const StoredEdge edge{loop.match, loop.query, loop.T_match_query, loop.information, loop};
    if (const Status status = store_->add(edge); !status) return status;
    if (attaches)
      log_to(log_, LogLevel::kInfo, to_text(loop.query) + ": found again in the map, at " + to_text(loop.match));
  }
  return ok();
}

// Places of earlier sessions then lie to each other as the map has them.
Status SlamBackEnd::settle_session() {
  if (Status stored = decide_all(); !stored) return stored;
  if (Status settled = graph_.settle(); !settled) return settled;
  if (Status compared = compare_with_visits(*store_, graph_, session_.id); !compared) return compared;
  for (const StoredMapPose& each : poses_of_places())
    recognition_.set_point(each.keyframe, point_in_map(each.T_map_lidar, each.part));
  return ok();
}

Status SlamBackEnd::decide_all() {
  std::size_t entered = 0;
  return enter(graph_.decide_all(), entered);
}

// All or nothing: half an index would be a damaged map.
Status SlamBackEnd::settle() {
  Status done = settle_map(*store_, graph_, log_);
  if (done) done = write_map_poses();
  if (done) done = compare_with_visits(*store_, graph_, session_.id);
  if (done) done = learn_look_alikes();
  if (!done) (void)store_->roll_back();
  return done;
}

Status SlamBackEnd::add_gps(const GpsFix& fix) {
  for (const auto& [keyframe, stamp_s] : fixes_.add(fix))
    if (graph_.has(keyframe))
      if (const Status added = add_fix(keyframe, stamp_s); !added) return added;
  return ok();
}

Status SlamBackEnd::add_fix(FrameId keyframe, double stamp_s) {
  const auto fix = fixes_.fix_of(keyframe, stamp_s, graph_.T_world_lidar(keyframe).translation());
  return fix ? store_->add(StoredFix{keyframe, *fix}) : ok();
}

// Readings are means over seconds: of those that share readings of the accelerometer, one is kept.
Status SlamBackEnd::add_up(FrameId keyframe, double stamp_s, const Eigen::Vector3f& up) {
  constexpr double kApart_s = 4.0;
  if (last_up_s_ && std::abs(stamp_s - *last_up_s_) < kApart_s) return ok();
  last_up_s_ = stamp_s;
  return store_->add(StoredUp{keyframe, up.cast<double>().normalized()});
}

Status SlamBackEnd::set_map_poses() {
  std::vector<StoredMapPose> poses;
  poses.reserve(graph_.keyframes().size());
  for (const FrameId frame : graph_.keyframes())
    poses.push_back({frame, graph_.T_world_lidar(frame), graph_.part(frame)});
  return store_->set_map_poses(poses);
}

Status SlamBackEnd::renumber_parts(const StoredMap& map) {
  std::map<int, int> renumbered;
  for (const auto& each : map.keyframes)
    if (each.settled) renumbered[each.settled->part] = graph_.part(each.frame.frame);
  auto earth = store_->earth();
  if (!earth) return earth.error();
  for (StoredEarth& each : *earth)
    if (const auto found = renumbered.find(each.part); found != renumbered.end()) each.part = found->second;
  if (Status set = store_->set_earth(*earth); !set) return set;
  return set_map_poses();
}

Status SlamBackEnd::write_map_poses() {
  if (Status written = set_map_poses(); !written) return written;
  const Status saved = recognition_.index().save(
      [this](std::size_t offset, std::span<const std::byte> piece) { return store_->add_index(offset, piece); });
  return saved ? store_->set_place_poses(poses_of_places()) : saved;
}

std::vector<StoredMapPose> SlamBackEnd::poses_of_places() const {
  const PlaceIndex& index = recognition_.index();
  std::vector<StoredMapPose> poses;
  poses.reserve(index.size());
  for (std::size_t i = 0; i < index.size(); ++i) {
    const FrameId frame = index.frame(i);
    poses.push_back({frame, graph_.T_world_lidar(frame), graph_.part(frame)});
  }
  return poses;
}

// For those who will look for scans in the map.
Status SlamBackEnd::learn_look_alikes() {
  const auto learnt = recognition_.learn_look_alikes_of_map(
      [this](FrameId frame) { return point_in_map(graph_.T_world_lidar(frame), graph_.part(frame)); }, facts_.typical);
  if (!learnt) return learnt.error();
  facts_.look_alikes_log_odds = *learnt;
  session_.sensor = to_text(facts_);
  return store_->set(session_);
}

FrameTime SlamBackEnd::time_in_index(const FrameTime& frame) {
  constexpr double kBetweenSessions_s = 1e4;
  if (const int session = session_of(frame.frame); session != newest_session_) {
    stamp_shift_s_ = newest_session_ < 0 ? 0.0 : newest_stamp_s_ + kBetweenSessions_s - frame.stamp_s;
    newest_session_ = session;
  }
  newest_stamp_s_ = std::max(newest_stamp_s_, frame.stamp_s + stamp_shift_s_);
  return {frame.frame, frame.stamp_s + stamp_shift_s_};
}

Status SlamBackEnd::restore(const StoredMap& map, const StoredSession& session, StateReader* state) {
  session_ = session;
  const auto facts = to_sensor_facts(session.sensor);
  if (!facts) return facts.error();
  if (*facts) facts_ = **facts;
  if (map.keyframes.empty()) return ok();
  if (!state)
    if (const Status status = restore_graph(map, graph_); !status) return status;
  const auto own = std::find_if(map.keyframes.begin(), map.keyframes.end(),
                                [&](const auto& each) { return session_of(each.frame.frame) == session_.id; });
  const auto restore_place = [&](const StoredMap::Keyframe& each, const IntensityScanContext& descriptor) {
    const FrameId frame = each.frame.frame;
    const bool is_earlier = session_of(frame) != session_.id;
    if (!is_earlier) (void)time_in_index(own->frame);  // a session begins with its first key frame, place or not
    const bool is_in_map = is_earlier && !state;
    recognition_.restore(time_in_index(each.frame), descriptor,
                         is_in_map ? point_in_map(graph_.T_world_lidar(frame), graph_.part(frame)) : each.point);
  };
  if (Status places = restore_places(*store_, map, parameters_.descriptor, restore_place); !places) return places;
  if (!state) return ok();
  archive(*state);
  const auto& keyframes = graph_.keyframes();
  state->require(std::equal(keyframes.begin(), keyframes.end(), map.keyframes.begin(), map.keyframes.end(),
                            [](FrameId frame, const auto& row) { return frame == row.frame.frame; }));
  return ok();
}

}  // namespace revisit
