// SPDX-License-Identifier: Apache-2.0
#include <revisit/pipeline/loop_detector.hpp>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numeric>
#include <stdexcept>

#include <oneapi/tbb/parallel_for.h>

namespace revisit {
namespace {

constexpr int kOverheadReach_m = 6;    // a translation that retrieval may be off
constexpr double kMostInFavour = 3.0;  // log odds that other answers may add to a candidate's

}  // namespace

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
  auto prepared = prepare_next(std::move(scan));
  if (!prepared) return prepared.error();
  auto detection = detect(*prepared, T_world_lidar, Past::kOldEnough);
  if (!detection) return detection.error();
  remember(*std::move(prepared), T_world_lidar);
  return detection;
}

double LoopDetector::Opinion::score() const {
  // Registration knows best, then the view from overhead, then the descriptors. Flattened, so that no two sure ones
  // are equal.
  constexpr double kFlat = 6.0;
  const double registered = geometric ? 1.0 / (1.0 + std::exp(-geometric->log_odds / kFlat)) : 0.0;
  const double evidence = candidate.geometry_score / 4.0 + overlap / 4.0 + registered;
  if (!geometric || !reason.empty()) return evidence;
  // A loop over more than this is a right constraint, but not the same place (docs/evaluation.md).
  // Poses have errors: close to the limit it is open which of the two it is.
  constexpr double kSamePlace_m = 4.0, kOpen_m = 0.5;
  return evidence + 1.0 + std::clamp((kSamePlace_m - distance_m()) / kOpen_m, 0.0, 1.0);
}

Status LoopDetector::add(Scan scan, const std::optional<Pose>& T_world_lidar) {
  auto prepared = prepare_next(std::move(scan));
  if (!prepared) return prepared.error();
  remember(*std::move(prepared), T_world_lidar);
  return ok();
}

Result<Detection> LoopDetector::localise(Scan scan) {
  const auto prepared = prepare(std::move(scan));
  if (!prepared) return prepared.error();
  return detect(*prepared, std::nullopt, Past::kAll);
}

Result<PreparedScan> LoopDetector::prepare_next(Scan scan) {
  // Without times nothing can be undone.
  const bool is_swept = !scan.times_s.empty();
  const std::optional<Twist> motion = is_swept ? ego_motion_.expected(scan.stamp_s) : std::nullopt;
  auto prepared = prepare(std::move(scan), motion);
  if (prepared && (is_swept || !ego_motion_.knows_intensities())) {
    prepared->geometry = std::make_shared<ScanGeometry>(prepared->cloud);
    ego_motion_.learn(prepared->scan.stamp_s, prepared->geometry);
  }
  return prepared;
}

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
  if (past == Past::kOldEnough)
    detection.newest_searchable = index_.newest_searchable(detection.frame, stamp_s);
  else if (!places_.empty())
    detection.newest_searchable = places_.rbegin()->first;
  auto candidates = past == Past::kAll ? index_.search_all(prepared.descriptor)
                                       : index_.search(detection.frame, stamp_s, prepared.descriptor);
  if (!candidates) return candidates.error();
  detection.candidates = *std::move(candidates);
  detection.search_ms = watch.lap_ms();
  if (detection.candidates.empty())
    detection.reason = detection.newest_searchable ? "no place like it" : "no searchable past";
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
  std::vector<Opinion> opinions;
  for (const LoopCandidate& candidate : detection.candidates) opinions.emplace_back(candidate);
  Stopwatch watch;
  OverheadSearch overhead(prepared.cloud);
  if (parameters_.geometric.overhead_search) {
    for (Opinion& each : opinions) look_from_overhead(overhead, each);
    std::stable_sort(opinions.begin(), opinions.end(),
                     [](const Opinion& a, const Opinion& b) { return a.overlap > b.overlap; });
  }
  const auto count = std::min(opinions.size(), static_cast<std::size_t>(parameters_.geometric.candidates));
  opinions.erase(opinions.begin() + static_cast<std::ptrdiff_t>(count), opinions.end());
  detection.geometric_ms += watch.lap_ms();
  for (Opinion& each : opinions) check_temporal_and_scores(detection.frame, each);
  detection.temporal_ms += watch.lap_ms();

  // Each candidate is registered on its own; who finishes first does not matter.
  std::shared_ptr<const ScanGeometry> query = prepared.geometry;
  if (!query && std::any_of(opinions.begin(), opinions.end(), [](const Opinion& o) { return o.reason.empty(); }))
    query = std::make_shared<ScanGeometry>(prepared.cloud);
  const auto register_one = [&](Opinion& each, double prior_log_odds) {
    ScanGeometry match(places_.at(each.candidate.match).cloud);
    CandidateView view{each.T_guess_match_query, each.overlap};
    view.prior_log_odds = prior_log_odds;
    if (const auto usual = ego_motion_.usual_intensity_correlation()) view.usual_intensity_correlation = *usual;
    each.geometric = check_geometric(match, *query, view, parameters_.geometric);
    each.reason = each.geometric->reason;
  };
  tbb::parallel_for(std::size_t{0}, count, [&](std::size_t i) {
    if (opinions[i].reason.empty())
      register_one(opinions[i], what_neighbours_say(detection.frame, opinions[i].candidate.match));
  });

  for (const Opinion& each : opinions)
    if (each.geometric) detection.registered.push_back({each.candidate.match, *each.geometric});

  // The answer is the one that fits best.
  const Opinion* best = nullptr;
  for (const Opinion& each : opinions)
    if (best == nullptr || each.score() > best->score()) best = &each;
  if (best == nullptr) return;
  Opinion answer = *best;
  if (answer.reason.empty() && parameters_.geometric.overhead_search)
    if (auto nearer = nearer_place(overhead, answer, detection)) {
      check_temporal_and_scores(detection.frame, *nearer);
      // That the scan was found next to it speaks for it as much as neighbours can.
      if (nearer->reason.empty()) register_one(*nearer, kMostInFavour);
      if (nearer->reason.empty() && nearer->distance_m() < answer.distance_m()) answer = *std::move(nearer);
    }
  detection.geometric_ms += watch.lap_ms();

  detection.answer = answer.candidate;
  detection.temporal = std::move(answer.temporal);
  detection.score = answer.score();
  detection.reason = answer.reason;
  detection.geometric = std::move(answer.geometric);
  if (detection.geometric && detection.geometric->evidence.inlier_ratio >= parameters_.geometric.min_inlier_ratio) {
    recent_answers_.push_back({detection.frame, answer.candidate.match, loop_log_odds(detection.geometric->evidence)});
    if (recent_answers_.size() > kAnswersRemembered) recent_answers_.pop_front();
  }
  if (detection.reason.empty()) {
    const GeometricEvidence& found = *detection.geometric;
    detection.loop =
        LoopConstraint{detection.frame,       answer.candidate.match, found.T_match_query, found.evidence.inlier_ratio,
                       found.evidence.rmse_m, found.probability,      found.information};
  }
}

double LoopDetector::what_neighbours_say(FrameId query, FrameId match) const {
  // Scans that follow each other see much the same: each counts for a part of what it says, and all for a limited sum.
  constexpr std::int64_t kRecent_frames = 10;
  constexpr double kShare = 0.3, kMostAgainst = 1.0;
  double sum = 0.0;
  for (const RecentAnswer& answer : recent_answers_) {
    const std::int64_t since = query.value - answer.query.value;
    if (since > 0 && since <= kRecent_frames &&
        std::abs(match.value - answer.match.value) <= parameters_.retrieval.separation_frames + 2 * since)
      sum += kShare * answer.log_odds;
  }
  return std::clamp(sum, -kMostAgainst, kMostInFavour);
}

void LoopDetector::look_from_overhead(OverheadSearch& overhead, Opinion& opinion) const {
  // Half a sector of the descriptor and a little more.
  const double yaw_reach_rad = kPi / parameters_.descriptor.sectors + to_radians(3.0);
  const OverheadMatch found = overhead.search(places_.at(opinion.candidate.match).cloud, opinion.candidate.yaw_rad,
                                              yaw_reach_rad, kOverheadReach_m);
  opinion.T_guess_match_query = planar_pose(found.x_m, found.y_m, found.yaw_rad);
  opinion.overlap = found.overlap;
  if (found.overlap < parameters_.geometric.min_overlap) {
    char text[96];
    std::snprintf(text, sizeof text, "overlap from overhead %.2f below %.2f", found.overlap,
                  parameters_.geometric.min_overlap);
    opinion.reason = text;
  }
}

void LoopDetector::check_temporal_and_scores(FrameId frame, Opinion& opinion) const {
  const auto query_descriptor = [&](FrameId of) -> std::optional<DescriptorView> {
    const auto found = std::find_if(recent_queries_.begin(), recent_queries_.end(),
                                    [&](const auto& each) { return each.first == of; });
    if (found == recent_queries_.end()) return std::nullopt;
    return found->second;
  };
  const auto match_descriptor = [&](FrameId of) { return index_.find(of); };
  opinion.temporal =
      check_temporal(frame, opinion.candidate.match, query_descriptor, match_descriptor, parameters_.temporal);
  if (!opinion.reason.empty()) return;
  if (opinion.candidate.score() < parameters_.geometric.min_descriptor_score) {
    char text[96];
    std::snprintf(text, sizeof text, "descriptor score %.3f below %.3f", opinion.candidate.score(),
                  parameters_.geometric.min_descriptor_score);
    opinion.reason = text;
  } else if (!opinion.temporal.consistent) {
    opinion.reason = opinion.temporal.reason;
  }
}

std::optional<LoopDetector::Opinion> LoopDetector::nearer_place(OverheadSearch& overhead, const Opinion& answer,
                                                                const Detection& detection) const {
  constexpr double kNear_m = 1.5;
  const Pose& T = answer.geometric->T_match_query;
  if (answer.distance_m() < kNear_m) return std::nullopt;
  const double yaw_rad = yaw_of(T);
  const std::int64_t around = 2 * std::int64_t{parameters_.retrieval.separation_frames};
  std::optional<Opinion> nearest;
  double least_m = answer.distance_m();
  for (std::int64_t frame = answer.candidate.match.value - around; frame <= answer.candidate.match.value + around;
       ++frame) {
    const auto place = places_.find(FrameId{frame});
    if (place == places_.end() || *detection.newest_searchable < FrameId{frame} ||
        frame == answer.candidate.match.value)
      continue;
    const OverheadMatch found = overhead.search(place->second.cloud, yaw_rad, to_radians(3.0), kOverheadReach_m);
    const double distance_m = std::hypot(found.x_m, found.y_m);
    if (found.overlap < parameters_.geometric.min_overlap || distance_m >= least_m) continue;
    least_m = distance_m;
    nearest.emplace(answer.candidate);
    nearest->candidate.match = FrameId{frame};
    nearest->T_guess_match_query = planar_pose(found.x_m, found.y_m, found.yaw_rad);
    nearest->overlap = found.overlap;
  }
  return nearest;
}

void LoopDetector::remember(PreparedScan prepared, const std::optional<Pose>& T_world_lidar) {
  index_.add(prepared.scan.frame, prepared.scan.stamp_s, prepared.descriptor);
  places_[prepared.scan.frame] = {std::move(prepared.cloud), T_world_lidar};
}

}  // namespace revisit
