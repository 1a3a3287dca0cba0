// SPDX-License-Identifier: Apache-2.0
#include <revisit/pipeline/loop_detector.hpp>

#include <algorithm>
#include <cstdio>
#include <numeric>
#include <stdexcept>

#include <oneapi/tbb/parallel_for.h>

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
                           IntensityCalibration calibration, LogSink log)
    : parameters_(parameters),
      scale_(std::move(scale)),
      calibration_(std::move(calibration)),
      log_(std::move(log)),
      index_(parameters.retrieval) {
  if (const Status status = validate(parameters); !status) throw std::invalid_argument(status.error().message);
}

Result<Detection> LoopDetector::process(Scan scan, const std::optional<Pose>& T_world_lidar) {
  auto prepared = prepare(std::move(scan));
  if (!prepared) return prepared.error();
  auto detection = detect(*prepared, T_world_lidar, Past::kOldEnough);
  if (!detection) return detection.error();
  remember(*std::move(prepared), T_world_lidar);
  return detection;
}

Status LoopDetector::add(Scan scan, const std::optional<Pose>& T_world_lidar) {
  auto prepared = prepare(std::move(scan));
  if (!prepared) return prepared.error();
  remember(*std::move(prepared), T_world_lidar);
  return ok();
}

Result<Detection> LoopDetector::localise(Scan scan) {
  const auto prepared = prepare(std::move(scan));
  if (!prepared) return prepared.error();
  return detect(*prepared, std::nullopt, Past::kAll);
}

Result<PreparedScan> LoopDetector::prepare(Scan scan) {
  if (!scale_) {
    scale_ = estimate_intensity_scale(std::span<const Scan>(&scan, 1), parameters_.intensity);
    if (!scale_->warning.empty()) log_to(log_, LogLevel::kWarning, scale_->warning);
  }
  auto prepared = prepare_scan(std::move(scan), parameters_, *scale_, calibration_);
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
                                       Past past) {
  Detection detection;
  detection.frame = prepared.scan.frame;
  detection.points = prepared.scan.points.size();
  detection.ground_points =
      std::accumulate(prepared.ground.is_ground.begin(), prepared.ground.is_ground.end(), std::size_t{0});
  detection.rings = prepared.ground.rings;
  detection.preparation_ms = prepared.ms;

  Stopwatch watch;
  const double stamp_s = prepared.scan.stamp_s;
  detection.had_searchable_past =
      past == Past::kAll ? index_.size() > 0 : index_.has_searchable_past(detection.frame, stamp_s);
  auto candidates = past == Past::kAll ? index_.search_all(prepared.descriptor)
                                       : index_.search(detection.frame, stamp_s, prepared.descriptor);
  if (!candidates) return candidates.error();
  detection.candidates = *std::move(candidates);
  detection.search_ms = watch.lap_ms();
  if (detection.candidates.empty())
    detection.reason = detection.had_searchable_past ? "no place like it" : "no searchable past";
  else
    verify(detection, prepared);

  if (detection.answer && T_world_lidar)
    if (const auto& T_world_match = places_.at(detection.answer->match).T_world_lidar)
      detection.T_match_query_by_odometry = T_world_match->inverse() * *T_world_lidar;

  recent_queries_.emplace_back(detection.frame, prepared.descriptor);
  while (recent_queries_.size() > static_cast<std::size_t>(parameters_.temporal.frames)) recent_queries_.pop_front();
  return detection;
}

void LoopDetector::verify(Detection& detection, const PreparedScan& prepared) {
  const auto query_descriptor = [&](FrameId frame) -> std::optional<DescriptorView> {
    const auto found = std::find_if(recent_queries_.begin(), recent_queries_.end(),
                                    [&](const auto& each) { return each.first == frame; });
    if (found == recent_queries_.end()) return std::nullopt;
    return found->second;
  };
  const auto match_descriptor = [&](FrameId frame) { return index_.find(frame); };
  const auto count = std::min(detection.candidates.size(), static_cast<std::size_t>(parameters_.geometric.candidates));
  struct Opinion {
    TemporalEvidence temporal;
    std::optional<GeometricEvidence> geometric;
    std::string reason;
  };
  std::vector<Opinion> opinions(count);
  Stopwatch watch;
  for (std::size_t i = 0; i < count; ++i) {
    const LoopCandidate& candidate = detection.candidates[i];
    Opinion& opinion = opinions[i];
    opinion.temporal =
        check_temporal(detection.frame, candidate.match, query_descriptor, match_descriptor, parameters_.temporal);
    if (candidate.score() < parameters_.geometric.min_descriptor_score) {
      char text[96];
      std::snprintf(text, sizeof text, "descriptor score %.3f below %.3f", candidate.score(),
                    parameters_.geometric.min_descriptor_score);
      opinion.reason = text;
    } else if (!opinion.temporal.consistent) {
      opinion.reason = opinion.temporal.reason;
    }
  }
  detection.temporal_ms += watch.lap_ms();

  // Each candidate is registered on its own; who finishes first does not matter.
  std::optional<ScanGeometry> query;
  if (std::any_of(opinions.begin(), opinions.end(), [](const Opinion& o) { return o.reason.empty(); }))
    query.emplace(prepared.cloud);
  tbb::parallel_for(std::size_t{0}, count, [&](std::size_t i) {
    if (!opinions[i].reason.empty()) return;
    ScanGeometry match(places_.at(detection.candidates[i].match).cloud);
    opinions[i].geometric = check_geometric(match, *query, detection.candidates[i].yaw_rad, parameters_.geometric);
    opinions[i].reason = opinions[i].geometric->reason;
  });
  detection.geometric_ms += watch.lap_ms();

  for (std::size_t i = 0; i < count && !detection.loop; ++i) {
    const LoopCandidate& candidate = detection.candidates[i];
    Opinion& opinion = opinions[i];
    // The answer is the first candidate, unless a later one fits the scan better.
    const double score = candidate.score() / 2.0 + (opinion.geometric ? opinion.geometric->inlier_ratio : 0.0);
    const bool is_loop = opinion.reason.empty();
    if (detection.answer && !is_loop && score <= detection.score) continue;
    detection.answer = candidate;
    detection.temporal = std::move(opinion.temporal);
    detection.score = score;
    detection.reason = opinion.reason;
    detection.geometric = std::move(opinion.geometric);
    if (is_loop)
      detection.loop = LoopConstraint{detection.frame, candidate.match, detection.geometric->T_match_query,
                                      detection.geometric->inlier_ratio, detection.geometric->rmse_m};
  }
}

void LoopDetector::remember(PreparedScan prepared, const std::optional<Pose>& T_world_lidar) {
  index_.add(prepared.scan.frame, prepared.scan.stamp_s, prepared.descriptor);
  places_[prepared.scan.frame] = {std::move(prepared.cloud), T_world_lidar};
}

}  // namespace revisit
