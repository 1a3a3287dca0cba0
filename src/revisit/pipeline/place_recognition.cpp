// SPDX-License-Identifier: Apache-2.0
#include <revisit/pipeline/place_recognition.hpp>

#include <algorithm>
#include <numeric>

#include <revisit/core/stopwatch.hpp>
#include <revisit/descriptors/similarity.hpp>
#include <revisit/retrieval/either_view.hpp>
#include <revisit/verification/elsewhere.hpp>
#include <revisit/verification/loop_verification.hpp>

namespace revisit {
namespace {

constexpr std::size_t kLearnsEvery = 4;  // queries: how much alike places are changes slowly

}  // namespace

Result<Detection> PlaceRecognition::find(const PreparedScan& query, std::size_t places, const TypicalAgreement& typical,
                                         bool is_thorough) {
  Detection detection;
  detection.frame = query.scan.frame;
  detection.searchable_places = places;
  detection.points = query.scan.points.size();
  detection.ground_points =
      std::accumulate(query.ground.is_ground.begin(), query.ground.is_ground.end(), std::size_t{0});
  detection.rings = query.ground.rings;
  detection.preparation_ms = query.ms;

  Stopwatch watch;
  auto candidates = this->candidates(query, places);
  if (!candidates) return candidates.error();
  detection.candidates = *std::move(candidates);
  detection.search_ms = watch.lap_ms();
  if (detection.candidates.empty())
    detection.refusal = Refusal{places == 0 ? Refusal::Reason::kNoSearchablePast : Refusal::Reason::kNoCandidate};
  if (const Status status = verify(query, typical, is_thorough, detection); !status) return status.error();

  recent_queries_.push_back({detection.frame, query.descriptor});
  if (recent_queries_.size() > kTemporalPairs) recent_queries_.pop_front();
  return detection;
}

Result<std::vector<LoopCandidate>> PlaceRecognition::candidates(const PreparedScan& query, std::size_t places) const {
  if (!retrieval_) return search_either_view(index_, query.descriptor, places, parameters_.retrieval);
  std::vector<LoopCandidate> candidates;
  for (const FrameId frame : retrieval_(query, places)) {
    const auto descriptor = index_.find(frame);
    if (!descriptor) continue;
    candidates.push_back(match_descriptors(query.descriptor, *descriptor));
    candidates.back().match = frame;
  }
  return candidates;
}

VerificationContext PlaceRecognition::context(const TypicalAgreement& typical, const LoopFollowing& following,
                                              FrameId newest) const {
  return {.parameters = parameters_,
          .clouds = *clouds_,
          .geometries = geometries_,
          .query_descriptor = [this](FrameId frame) -> std::optional<DescriptorView> {
            const auto found = std::find_if(recent_queries_.begin(), recent_queries_.end(),
                                            [&](const RecentQuery& each) { return each.frame == frame; });
            if (found == recent_queries_.end()) return std::nullopt;
            return found->descriptor;
          },
          .place_descriptor = [this](FrameId frame) { return index_.find(frame); },
          .places = points_,
          .following = following,
          .typical = typical,
          .look_alikes_log_odds = look_alikes_log_odds(),
          .newest = newest,
          .is_one_drive = is_one_drive_};
}

Result<Hypothesis> PlaceRecognition::test(const PreparedScan& query, const PosePrediction& prediction,
                                          const TypicalAgreement& typical) {
  const VerificationQuery question{query.scan.frame, query.descriptor, query.cloud, query.geometry, std::nullopt};
  const VerificationContext context = this->context(typical, following_);
  CandidateRegistration registration(context, question);
  auto hypothesis = registration.test(prediction);
  if (hypothesis && hypothesis->geometric)
    refine(*hypothesis->geometric, *hypothesis->geometry, registration.query_geometry());
  return hypothesis;
}

Result<std::shared_ptr<const ScanGeometry>> PlaceRecognition::geometry(FrameId place) const {
  if (auto known = geometries_.find(place)) return known;
  const auto cloud = clouds_->get(place);
  if (!cloud) return cloud.error();
  auto geometry = std::make_shared<const ScanGeometry>(**cloud);
  geometries_.keep(place, geometry);
  return geometry;
}

Status PlaceRecognition::verify(const PreparedScan& query, const TypicalAgreement& typical, bool is_thorough,
                                Detection& detection) {
  Stopwatch watch;
  const VerificationQuery question{query.scan.frame, query.descriptor, query.cloud, query.geometry,
                                   query.trajectory_point};
  VerificationContext context = this->context(
      typical, following_, detection.candidates.empty() ? FrameId{} : index_.frame(detection.searchable_places - 1));
  context.is_thorough = is_thorough;
  LoopVerification verification(context, question);
  if (queries_++ % kLearnsEvery == 0 && parameters_.geometric.overhead_search)
    if (const Status status = learn_look_alikes(query, verification.registration()); !status) return status;
  if (detection.candidates.empty()) return ok();
  auto answer = verification.verify(detection.candidates);
  if (!answer) return answer.error();
  detection.tried_further = verification.has_tried_further();
  conclude(verification, *std::move(answer), detection);
  if (is_to_be_followed(detection, query.trajectory_point))
    following_.add(*query.trajectory_point, detection.loop->match, *points_.at(detection.loop->match),
                   detection.loop->T_match_query, detection.geometric->log_odds);
  detection.temporal_ms = verification.registration().temporal_ms();
  detection.geometric_ms = watch.lap_ms();
  return ok();
}

Result<Detection> PlaceRecognition::find_there(const PreparedScan& query, Detection before,
                                               const TypicalAgreement& typical) {
  const VerificationQuery question{query.scan.frame, query.descriptor, query.cloud, query.geometry,
                                   query.trajectory_point};
  const VerificationContext context = this->context(typical, following_);
  LoopVerification verification(context, question);
  std::vector<Hypothesis> tested;
  for (Detection::Registered& each : before.registered) {
    Hypothesis& hypothesis = tested.emplace_back();
    hypothesis.candidate.match = each.match;
    hypothesis.refusal = each.evidence.refusal;
    hypothesis.geometric = std::move(each.evidence);
  }
  auto answer = verification.verify_there(tested);
  if (!answer) return answer.error();
  before.registered.clear();
  before.loop.reset();
  conclude(verification, *std::move(answer), before);
  return before;
}

void PlaceRecognition::conclude(LoopVerification& verification, std::optional<Hypothesis> answer,
                                Detection& detection) const {
  for (const Hypothesis& each : verification.hypotheses())
    if (each.geometric) detection.registered.push_back({each.candidate.match, *each.geometric});
  if (answer) this->answer(*std::move(answer), verification.registration().query_geometry(), detection);
}

// The place elsewhere that looks most like the scan, as retrieval would have it.
Status PlaceRecognition::learn_look_alikes(const PreparedScan& query, CandidateRegistration& registration) {
  if (!query.trajectory_point) return ok();
  std::optional<FrameId> most_alike;
  double best = 0.0;
  for (const FrameId place : places_elsewhere(points_, *query.trajectory_point)) {
    const auto descriptor = index_.find(place);
    if (!descriptor) continue;
    const double score = match_descriptors(query.descriptor, *descriptor).score();
    if (most_alike && score <= best) continue;
    most_alike = place;
    best = score;
  }
  if (!most_alike) return ok();
  const auto log_odds =
      registration.log_odds_elsewhere(*most_alike, T_between(*points_.at(*most_alike), *query.trajectory_point));
  if (!log_odds) return log_odds.error();
  if (*log_odds) look_alikes_.add(**log_odds);
  return ok();
}

// Its own evidence must speak for it: where nothing is to be seen, a robot is not followed for ever.
bool PlaceRecognition::is_to_be_followed(const Detection& detection,
                                         const std::optional<TrajectoryPoint>& point) const {
  return parameters_.geometric.follow && detection.loop && point && points_.at(detection.loop->match) &&
         detection.geometric->own_log_odds > 0.0;
}

void PlaceRecognition::answer(Hypothesis hypothesis, const ScanGeometry& query_geometry, Detection& detection) {
  detection.score = hypothesis.score();
  if (hypothesis.is_accepted()) {
    refine(*hypothesis.geometric, *hypothesis.geometry, query_geometry);
    detection.loop = to_loop(detection.frame, hypothesis.candidate.match, *hypothesis.geometric, detection.score);
  }
  detection.answer = hypothesis.candidate;
  detection.temporal = hypothesis.temporal;
  detection.refusal = hypothesis.refusal;
  detection.geometric = std::move(hypothesis.geometric);
}

Status PlaceRecognition::add(PreparedScan place) {
  const FrameId frame = place.scan.frame;
  if (const Status status = clouds_->put(frame, std::move(place.cloud)); !status) return status;
  restore({frame, place.scan.stamp_s}, place.descriptor, place.trajectory_point);
  return ok();
}

void PlaceRecognition::restore(const FrameTime& frame, const IntensityScanContext& descriptor,
                               const std::optional<TrajectoryPoint>& point) {
  index_.add(frame.frame, frame.stamp_s, descriptor);
  points_[frame.frame] = point;
}

}  // namespace revisit
