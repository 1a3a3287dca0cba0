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

double LoopDetector::Opinion::score() const {
  // Registration knows best, then the view from overhead, then the descriptors. Flattened, so that no two sure ones
  // are equal.
  constexpr double kFlat = 6.0;
  const double registered = geometric ? 1.0 / (1.0 + std::exp(-geometric->log_odds / kFlat)) : 0.0;
  const double evidence = candidate.geometry_score / 4.0 + overlap / 4.0 + registered;
  if (!geometric) return evidence;
  // A loop over more than this is a right constraint, but not the same place (docs/evaluation.md).
  // Poses have errors: close to the limit it is open which of the two it is.
  constexpr double kSamePlace_m = 4.0, kOpen_m = 0.5, kRefused = 0.2;
  const double same_place = std::clamp((kSamePlace_m - distance_m()) / kOpen_m, 0.0, 1.0);
  return reason.empty() ? evidence + 1.0 + same_place : evidence + kRefused * same_place;
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
  // Without times nothing can be undone.
  const bool is_swept = !scan.times_s.empty();
  const std::optional<Twist> motion = is_swept ? ego_motion_.expected(scan.stamp_s) : std::nullopt;
  auto prepared = prepare(std::move(scan), motion);
  if (prepared && (is_swept || !ego_motion_.knows_intensities())) learn_intensities(*prepared);
  return prepared;
}

void LoopDetector::learn_intensities(PreparedScan& prepared) {
  prepared.geometry = std::make_shared<ScanGeometry>(prepared.cloud);
  ego_motion_.learn(prepared.scan.stamp_s, prepared.geometry);
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
  else if (!T_world_places_.empty())
    detection.newest_searchable = T_world_places_.rbegin()->first;
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
  std::vector<Opinion> opinions;
  for (const LoopCandidate& candidate : detection.candidates) {
    auto place = clouds_->get(candidate.match);
    if (!place) return place.error();
    opinions.emplace_back(candidate).place = *std::move(place);
  }
  Stopwatch watch;
  OverheadSearch overhead(prepared.cloud);
  if (parameters_.geometric.overhead_search) {
    for (Opinion& each : opinions) look_from_overhead(overhead, *each.place, each);
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
    const ScanGeometry match(*each.place);
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

  weigh_against_each_other(detection.frame, opinions);
  for (const Opinion& each : opinions)
    if (each.geometric) detection.registered.push_back({each.candidate.match, *each.geometric});

  // The answer is the one that fits best.
  const Opinion* best = nullptr;
  for (const Opinion& each : opinions)
    if (best == nullptr || each.score() > best->score()) best = &each;
  if (best == nullptr) return ok();
  Opinion answer = *best;
  if (answer.reason.empty() && parameters_.geometric.overhead_search) {
    auto found = nearer_place(overhead, answer, detection);
    if (!found) return found.error();
    if (std::optional<Opinion>& nearer = *found) {
      check_temporal_and_scores(detection.frame, *nearer);
      // That the scan was found next to it speaks for it as much as neighbours can.
      if (nearer->reason.empty()) register_one(*nearer, kMostInFavour);
      if (nearer->reason.empty() && nearer->distance_m() < answer.distance_m()) answer = *std::move(nearer);
    }
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
  return ok();
}

void LoopDetector::weigh_against_each_other(FrameId query, std::vector<Opinion>& opinions) const {
  // Where a scene shows little, even the right place fits poorly; that all others fit far worse speaks for it then.
  // Chosen on recordings that no reported figure uses (docs/accuracy.md).
  constexpr double kNothingBelow = 8.0, kShare = 0.5, kMost = 5.0;
  for (Opinion& each : opinions) {
    if (!each.geometric) continue;
    const double own = loop_log_odds(each.geometric->evidence);
    std::optional<double> runner_up;
    for (const Opinion& other : opinions)
      if (other.geometric &&
          std::abs(other.candidate.match.value - each.candidate.match.value) > parameters_.retrieval.separation_frames)
        runner_up = std::max(runner_up.value_or(-1e9), loop_log_odds(other.geometric->evidence));
    if (!runner_up) continue;
    const double says = std::clamp(kShare * (own - *runner_up - kNothingBelow), 0.0, kMost);
    if (says > what_neighbours_say(query, each.candidate.match)) {
      judge(*each.geometric, says, parameters_.geometric);
      each.reason = each.geometric->reason;
    }
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

void LoopDetector::look_from_overhead(OverheadSearch& overhead, const ThinCloud& place, Opinion& opinion) const {
  // Half a sector of the descriptor and a little more.
  const double yaw_reach_rad = kPi / parameters_.descriptor.sectors + to_radians(3.0);
  const OverheadMatch found = overhead.search(place, opinion.candidate.yaw_rad, yaw_reach_rad, kOverheadReach_m);
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

Result<std::optional<LoopDetector::Opinion>> LoopDetector::nearer_place(OverheadSearch& overhead, const Opinion& answer,
                                                                        const Detection& detection) const {
  constexpr double kNear_m = 1.5;
  const Pose& T = answer.geometric->T_match_query;
  std::optional<Opinion> nearest;
  if (answer.distance_m() < kNear_m) return nearest;
  const double yaw_rad = yaw_of(T);
  const std::int64_t around = 2 * std::int64_t{parameters_.retrieval.separation_frames};
  double least_m = answer.distance_m();
  for (std::int64_t frame = answer.candidate.match.value - around; frame <= answer.candidate.match.value + around;
       ++frame) {
    if (!T_world_places_.contains(FrameId{frame}) || *detection.newest_searchable < FrameId{frame} ||
        frame == answer.candidate.match.value)
      continue;
    auto place = clouds_->get(FrameId{frame});
    if (!place) return place.error();
    const OverheadMatch found = overhead.search(**place, yaw_rad, to_radians(3.0), kOverheadReach_m);
    const double distance_m = std::hypot(found.x_m, found.y_m);
    if (found.overlap < parameters_.geometric.min_overlap || distance_m >= least_m) continue;
    least_m = distance_m;
    nearest.emplace(answer.candidate);
    nearest->candidate.match = FrameId{frame};
    nearest->T_guess_match_query = planar_pose(found.x_m, found.y_m, found.yaw_rad);
    nearest->overlap = found.overlap;
    nearest->place = *std::move(place);
  }
  return nearest;
}

Status LoopDetector::remember(PreparedScan prepared, const std::optional<Pose>& T_world_lidar) {
  const FrameId frame = prepared.scan.frame;
  if (const Status status = clouds_->put(frame, std::move(prepared.cloud)); !status) return status;
  index_.add(frame, prepared.scan.stamp_s, prepared.descriptor);
  T_world_places_[frame] = T_world_lidar;
  return ok();
}

void LoopDetector::recall(FrameId frame, double stamp_s, const IntensityScanContext& descriptor) {
  index_.add(frame, stamp_s, descriptor);
  T_world_places_[frame] = std::nullopt;
}

}  // namespace revisit
