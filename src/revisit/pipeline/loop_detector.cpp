// SPDX-License-Identifier: Apache-2.0
#include <revisit/pipeline/loop_detector.hpp>

#include <numeric>
#include <stdexcept>

namespace revisit {

CandidateRow Detection::row() const {
  CandidateRow row;
  row.query = frame;
  if (answer) row.match = answer->match;
  row.score = score;
  row.accepted = loop.has_value();
  row.reason = reason;
  return row;
}

LoopDetector::LoopDetector(const Parameters& parameters, std::optional<IntensityScale> scale,
                           IntensityCalibration calibration, LogSink log, std::unique_ptr<PlaceClouds> clouds)
    : parameters_(parameters),
      scale_(std::move(scale)),
      calibration_(std::move(calibration)),
      log_(std::move(log)),
      index_(parameters.retrieval),
      clouds_(clouds ? std::move(clouds) : clouds_in_memory()) {
  if (const Status status = validate(parameters); !status) throw std::invalid_argument(status.error().message);
}

Result<Detection> LoopDetector::process(Scan scan, const std::optional<Pose>& T_world_lidar) {
  auto prepared = prepare_next(std::move(scan));
  if (!prepared) return prepared.error();
  auto detection = detect(*prepared, T_world_lidar, Past{});
  if (!detection) return detection.error();
  if (const Status status = remember(*std::move(prepared), T_world_lidar); !status) return status.error();
  return detection;
}

Status LoopDetector::add(Scan scan, const std::optional<Pose>& T_world_lidar) {
  auto prepared = prepare_next(std::move(scan));
  if (!prepared) return prepared.error();
  return remember(*std::move(prepared), T_world_lidar);
}

Result<Detection> LoopDetector::localise(Scan scan) {
  const auto prepared = prepare(std::move(scan));
  if (!prepared) return prepared.error();
  return detect(*prepared, std::nullopt, Past{.is_all = true});
}

Result<PreparedScan> LoopDetector::prepare_next(Scan scan) {
  const bool is_swept = !scan.times_s.empty();
  const Scan raw = is_swept ? scan : Scan{};
  const std::optional<Twist> expected = ego_motion_.expected(scan.stamp_s);
  auto prepared = prepare(std::move(scan), expected);
  if (!prepared) return prepared;
  EgoMotion::Step step = find_motion(*prepared);
  // Points stand where the motion had them that was expected: where it was another, once more with that.
  constexpr double kWrong_m = 0.2;
  if (is_swept && step.motion && step.surprise_m > kWrong_m)
    if (auto swept_so = prepare(raw, step.motion)) {
      EgoMotion::Step so = find_motion(*swept_so);
      if (so.motion) {
        prepared = std::move(swept_so);
        step = std::move(so);
      }
    }
  ego_motion_.learn(std::move(step));
  prepared->station = ego_motion_.station();
  prepared->usual_inlier_ratio = ego_motion_.inlier_ratio_lately();
  return prepared;
}

EgoMotion::Step LoopDetector::find_motion(PreparedScan& prepared) const {
  prepared.geometry = std::make_shared<ScanGeometry>(prepared.cloud);
  return ego_motion_.find(prepared.scan.stamp_s, prepared.geometry);
}

void LoopDetector::learn_intensities(PreparedScan& prepared) { ego_motion_.learn(find_motion(prepared)); }

Result<PreparedScan> LoopDetector::prepare(Scan scan, const std::optional<Twist>& motion) {
  if (!scale_) {
    scale_ = estimate_intensity_scale(std::span<const Scan>(&scan, 1), parameters_.intensity);
    if (!scale_->warning.empty()) log_to(log_, LogLevel::kWarning, scale_->warning);
  }
  auto prepared = prepare_scan(std::move(scan), parameters_, *scale_, calibration_, motion);
  if (prepared && !rings_were_reported_) {
    rings_were_reported_ = true;
    const std::size_t known = calibration_.ring_gains.size(), seen = prepared->ground.ring_count;
    if (known != 0 && known != seen)
      log_to(log_, LogLevel::kWarning,
             "the intensity calibration knows " + std::to_string(known) + " laser rings, the scans show " +
                 std::to_string(seen) + ": its ring gains are left out (was it made with another sensor?)");
    log_to(log_, prepared->ground.rings == RingSource::kNone ? LogLevel::kWarning : LogLevel::kInfo,
           prepared->ground.rings == RingSource::kNone
               ? "no laser rings found: ground is segmented on a polar grid instead of the range image"
               : std::to_string(prepared->ground.ring_count) + " laser rings, " + to_string(prepared->ground.rings));
  }
  return prepared;
}

Result<Detection> LoopDetector::detect(const PreparedScan& prepared, const std::optional<Pose>& T_world_lidar,
                                       const Past& past) {
  Detection detection;
  detection.frame = prepared.scan.frame;
  detection.points = prepared.scan.points.size();
  detection.ground_points =
      std::accumulate(prepared.ground.is_ground.begin(), prepared.ground.is_ground.end(), std::size_t{0});
  detection.rings = prepared.ground.rings;
  detection.preparation_ms = prepared.ms;

  Stopwatch watch;
  // As if asked when those that may answer are just old enough.
  FrameId asked = detection.frame;
  double asked_s = prepared.scan.stamp_s;
  if (past.newest_frame_stamp_s) {
    asked.value = past.newest_frame_stamp_s->first.value + parameters_.retrieval.exclude_frames;
    asked_s = past.newest_frame_stamp_s->second + parameters_.retrieval.exclude_s;
  }
  if (!past.is_all)
    detection.newest_searchable = index_.newest_searchable(asked, asked_s);
  else if (!stations_.empty())
    detection.newest_searchable = stations_.rbegin()->first;
  auto candidates =
      past.is_all ? index_.search_all(prepared.descriptor) : index_.search(asked, asked_s, prepared.descriptor);
  if (!candidates) return candidates.error();
  detection.candidates = *std::move(candidates);
  detection.search_ms = watch.lap_ms();
  if (detection.candidates.empty())
    detection.reason = detection.newest_searchable ? "no place like it" : "no searchable past";
  else if (const Status status = verify(detection, prepared); !status)
    return status.error();

  if (detection.answer && T_world_lidar)
    if (const auto& T_world_match = T_world_places_.at(detection.answer->match))
      detection.T_match_query_by_odometry = T_world_match->inverse() * *T_world_lidar;

  recent_queries_.emplace_back(detection.frame, prepared.descriptor);
  while (recent_queries_.size() > static_cast<std::size_t>(parameters_.temporal.frames)) recent_queries_.pop_front();
  return detection;
}

Status LoopDetector::verify(Detection& detection, const PreparedScan& prepared) {
  Stopwatch watch;
  UsualAgreement usual = ego_motion_.usual();
  usual.inlier_ratio = prepared.usual_inlier_ratio.value_or(usual.inlier_ratio);
  LoopVerification verification({.parameters = parameters_,
                                 .index = index_,
                                 .clouds = *clouds_,
                                 .stations = stations_,
                                 .track = track_,
                                 .recent_queries = recent_queries_,
                                 .usual = usual,
                                 .newest = *detection.newest_searchable},
                                prepared);
  auto answer = verification.answer(detection.candidates);
  if (!answer) return answer.error();
  for (const Opinion& each : verification.opinions())
    if (each.geometric) detection.registered.push_back({each.candidate.match, *each.geometric});
  if (*answer) {
    Opinion& best = **answer;
    const std::optional<Station>& place = stations_.at(best.candidate.match);
    if (best.reason.empty()) {
      // What it shows itself must be in favour: where nothing is to be seen, a robot is not followed for ever.
      if (parameters_.geometric.follow && prepared.station && place && best.own_log_odds() > 0.0)
        track_.add(*prepared.station, best.candidate.match, *place, best.geometric->T_match_query,
                   best.geometric->log_odds);
      refine(*best.geometric, *best.geometry, verification.query_geometry());
      const GeometricEvidence& found = *best.geometric;
      detection.loop =
          LoopConstraint{detection.frame,       best.candidate.match, found.T_match_query, found.evidence.inlier_ratio,
                         found.evidence.rmse_m, found.probability,    found.information};
    }
    detection.answer = best.candidate;
    detection.temporal = best.temporal;
    detection.score = best.score();
    detection.reason = best.reason;
    detection.geometric = best.geometric;
  }
  detection.temporal_ms = verification.temporal_ms();
  detection.geometric_ms = watch.lap_ms();
  return ok();
}

Status LoopDetector::remember(PreparedScan prepared, const std::optional<Pose>& T_world_lidar) {
  const FrameId frame = prepared.scan.frame;
  if (const Status status = clouds_->put(frame, std::move(prepared.cloud)); !status) return status;
  index_.add(frame, prepared.scan.stamp_s, prepared.descriptor);
  T_world_places_[frame] = T_world_lidar;
  stations_[frame] = prepared.station;
  return ok();
}

void LoopDetector::recall(FrameId frame, double stamp_s, const IntensityScanContext& descriptor,
                          const std::optional<Station>& station) {
  index_.add(frame, stamp_s, descriptor);
  T_world_places_[frame] = std::nullopt;
  stations_[frame] = station;
}

}  // namespace revisit
