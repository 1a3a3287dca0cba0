// SPDX-License-Identifier: Apache-2.0
#include <revisit/verification/candidate_registration.hpp>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>

#include <oneapi/tbb/parallel_for.h>

#include <revisit/core/stopwatch.hpp>
#include <revisit/descriptors/similarity.hpp>
#include <revisit/verification/acceptance.hpp>
#include <revisit/verification/elsewhere.hpp>
#include <revisit/verification/look_alikes.hpp>

namespace revisit {
namespace {

// The overhead search turns in steps of 3 degrees: one more on either side.
const double kYawMargin_rad = to_radians(3.0);

// What a pose loses where odometry does not know how the two places lie to each other. In streets that are the same
// tree for tree, wrong ones reach 3.2 by themselves (OS0-128 and rosette along 08, seed 304). With 3 less in rooms, 242
// of a rosette's 349 loops on the storeys of a building were false; with 6 less none (docs/accuracy.md).
// With 3 less in the open, of the five loops of a rosette that had lost track (06, every third scan, seed 1821) four
// were in another street: where both are narrow, 6 less everywhere.
constexpr double kUnknownInTheOpen_log_odds = -3.0, kUnknownOtherwise_log_odds = -6.0;

// Chosen on walks through two yards (docs/accuracy.md, "A narrow view, widened").
struct Wider {
  static constexpr double kLeastAlone_log_odds = 0.0;
  static constexpr double kMostStddevAlone_m = 0.2;  ///< twice of what is asked otherwise
  static constexpr double kMostBeside_m = 0.25;
};

// Of the least overlap: a scan that comes alone has no other one beside it that may overlap more.
constexpr double kLessForOneAlone = 2.0 / 3.0;

}  // namespace

CandidateRegistration::CandidateRegistration(const VerificationContext& context, const VerificationQuery& query)
    : context_(context),
      options_(context.parameters.geometric),
      query_(query),
      overhead_(query.cloud),
      query_geometry_(query.geometry) {}

const ScanGeometry& CandidateRegistration::query_geometry() {
  if (!query_geometry_) query_geometry_ = std::make_shared<ScanGeometry>(query_.cloud);
  return *query_geometry_;
}

Result<Hypothesis> CandidateRegistration::open(const LoopCandidate& candidate) const {
  auto place = context_.clouds.get(candidate.match);
  if (!place) return place.error();
  Hypothesis hypothesis;
  hypothesis.candidate = candidate;
  hypothesis.place = *std::move(place);
  return hypothesis;
}

Result<std::vector<Hypothesis>> CandidateRegistration::open(std::span<const LoopCandidate> candidates) {
  std::vector<Hypothesis> hypotheses;
  std::optional<Hypothesis> elsewhere;  // the best of them
  for (const LoopCandidate& candidate : candidates) {
    if (const auto place = context_.places.find(candidate.match); options_.follow && place != context_.places.end())
      if (const auto refusal = refuse_elsewhere(place->second, query_.trajectory_point)) {
        if (!elsewhere) {
          elsewhere.emplace();
          elsewhere->candidate = candidate;
          elsewhere->refusal = refusal;
        }
        continue;
      }
    auto hypothesis = open(candidate);
    if (!hypothesis) return hypothesis.error();
    if (options_.overhead_search) {
      // The heading that the descriptors agreed on is one of several that may be right, as in a rectangular room.
      for (Hypothesis& each : search_overhead(*hypothesis, kPi, kPosesAPlace)) hypotheses.push_back(std::move(each));
      continue;
    }
    hypothesis->T_guess_match_query = from_upright(*hypothesis, planar_pose(0, 0, candidate.yaw_rad));
    hypotheses.push_back(*std::move(hypothesis));
  }
  if (hypotheses.empty() && elsewhere) return std::vector{*std::move(elsewhere)};
  if (options_.overhead_search) {
    const double least = query_.trajectory_point ? options_.min_overlap : kLessForOneAlone * options_.min_overlap;
    for (Hypothesis& each : hypotheses)
      if (each.overlap < least) each.refusal = Refusal{Refusal::Reason::kLowOverlap, each.overlap, least};
    std::stable_sort(hypotheses.begin(), hypotheses.end(),
                     [](const Hypothesis& a, const Hypothesis& b) { return a.overlap > b.overlap; });
  }
  return hypotheses;
}

Result<std::vector<Hypothesis>> CandidateRegistration::test(std::span<const LoopCandidate> candidates) {
  auto opened = open(candidates);
  if (!opened) return opened;
  untested_ = *std::move(opened);
  return test_next(static_cast<std::size_t>(options_.candidates));
}

std::vector<Hypothesis> CandidateRegistration::test_next(std::size_t count) {
  const auto end = untested_.begin() + static_cast<std::ptrdiff_t>(std::min(count, untested_.size()));
  std::vector<Hypothesis> hypotheses(std::move_iterator(untested_.begin()), std::move_iterator(end));
  untested_.erase(untested_.begin(), end);

  Stopwatch watch;
  for (Hypothesis& each : hypotheses) check_temporal_consistency(each);
  temporal_ms_ += watch.lap_ms();

  // Each is registered on its own; the order in which they finish does not matter.
  if (std::any_of(hypotheses.begin(), hypotheses.end(), [](const Hypothesis& each) { return !each.refusal; }))
    query_geometry();
  share_geometry(hypotheses);
  tbb::parallel_for(std::size_t{0}, hypotheses.size(), [&](std::size_t i) {
    if (!hypotheses[i].refusal) register_scans(hypotheses[i]);
  });
  return hypotheses;
}

Result<Hypothesis> CandidateRegistration::test(const PosePrediction& prediction) {
  LoopCandidate candidate;
  if (const auto descriptor = context_.place_descriptor(prediction.match))
    candidate = match_descriptors(query_.descriptor, *descriptor);
  candidate.match = prediction.match;
  auto hypothesis = open(candidate);
  if (!hypothesis) return hypothesis;
  hypothesis->candidate.yaw_rad =
      yaw_of(upright_pose(hypothesis->place->up) * prediction.T_match_query * upright_pose(query_.cloud.up).inverse());
  hypothesis = search_overhead(*hypothesis, kYawMargin_rad, 1).front();
  hypothesis->T_guess_match_query = prediction.T_match_query;
  check_temporal_consistency(*hypothesis);
  query_geometry();
  share_geometry({&*hypothesis, 1});
  if (!hypothesis->refusal) register_scans(*hypothesis, &prediction);
  return hypothesis;
}

Result<std::optional<double>> CandidateRegistration::log_odds_elsewhere(FrameId place, const Pose& T_place_query) {
  constexpr double kRight_m = 3.0;
  auto hypothesis = open({.match = place});
  if (!hypothesis) return hypothesis.error();
  Hypothesis found = search_overhead(*hypothesis, kPi, 1).front();
  if (found.overlap < options_.min_overlap) return std::optional(LookAlikes::kNotRegistered);
  query_geometry();
  share_geometry({&found, 1});
  register_scans(found);
  const Pose error = T_place_query.inverse() * found.geometric->T_match_query;
  if (error.translation().norm() < kRight_m) return std::optional<double>();
  return std::optional(loop_log_odds(found.geometric->evidence));
}

// Poses at the same place share its geometry, and so do queries that follow.
void CandidateRegistration::share_geometry(std::span<Hypothesis> hypotheses) const {
  std::map<FrameId, std::shared_ptr<const ScanGeometry>> of_place;
  for (const Hypothesis& each : hypotheses)
    if (!each.refusal) of_place[each.candidate.match];
  std::vector<const Hypothesis*> unknown;
  for (auto& [place, geometry] : of_place) {
    geometry = context_.geometries.find(place);
    if (!geometry)
      unknown.push_back(&*std::find_if(hypotheses.begin(), hypotheses.end(), [&place = place](const Hypothesis& each) {
        return each.candidate.match == place;
      }));
  }
  tbb::parallel_for(std::size_t{0}, unknown.size(), [&](std::size_t i) {
    of_place.at(unknown[i]->candidate.match) = std::make_shared<const ScanGeometry>(*unknown[i]->place);
  });
  for (const Hypothesis* each : unknown)
    context_.geometries.keep(each->candidate.match, of_place.at(each->candidate.match));
  for (Hypothesis& each : hypotheses)
    if (!each.refusal) each.geometry = of_place.at(each.candidate.match);
}

void CandidateRegistration::register_scans(Hypothesis& hypothesis, const PosePrediction* prediction) const {
  const auto register_from = [&](const Pose& T_guess_match_query) {
    return check_geometric(*hypothesis.geometry, *query_geometry_,
                           {T_guess_match_query, hypothesis.overlap, context_.typical}, options_);
  };
  hypothesis.geometric = register_from(hypothesis.T_guess_match_query);
  judge(hypothesis, prediction);
  look_wider(hypothesis, prediction);
  if (!options_.follow || !hypothesis.is_accepted()) return;
  // A registration that begins metres away may end beside the right pose. Where the loops before have another pose, a
  // second one begins there; of the two poses the one that the scans fit better counts.
  const auto T_by_loops =
      context_.following.pose_at(query_.trajectory_point, context_.places.at(hypothesis.candidate.match));
  if (!T_by_loops || agree(*T_by_loops, hypothesis.geometric->T_match_query, 0.0)) return;
  Hypothesis again = hypothesis;
  again.geometric = register_from(*T_by_loops);
  judge(again, prediction);
  if (again.own_log_odds() > hypothesis.own_log_odds()) hypothesis = std::move(again);
}

// Where two scans alone make a place likely but not sure, or hardly fix its position, what was seen shortly before them
// may decide. It was joined by odometry and has its errors, so both registrations must find the same pose.
void CandidateRegistration::look_wider(Hypothesis& hypothesis, const PosePrediction* prediction) const {
  using Reason = Refusal::Reason;
  const GeometricEvidence& alone = *hypothesis.geometric;
  if (!hypothesis.refusal ||
      (hypothesis.refusal->reason != Reason::kImprobable && hypothesis.refusal->reason != Reason::kSlides))
    return;
  if (alone.own_log_odds < Wider::kLeastAlone_log_odds || alone.evidence.stddev_m > Wider::kMostStddevAlone_m) return;
  if (!hypothesis.geometry->is_widened() && !query_geometry_->is_widened()) return;
  Hypothesis wider = hypothesis;
  wider.geometric = check_widened(*hypothesis.geometry, *query_geometry_,
                                  {alone.T_match_query, hypothesis.overlap, context_.typical}, options_);
  judge(wider, prediction);
  const Eigen::Vector3d beside_m = wider.geometric->T_match_query.translation() - alone.T_match_query.translation();
  if (wider.is_accepted() && beside_m.norm() <= Wider::kMostBeside_m) hypothesis = std::move(wider);
}

void CandidateRegistration::judge(Hypothesis& hypothesis, const PosePrediction* prediction) const {
  const auto& place = context_.places.at(hypothesis.candidate.match);
  const Pose& found = hypothesis.geometric->T_match_query;
  double support = context_.following.support_log_odds(query_.trajectory_point, place, found);
  if (prediction != nullptr && agree(prediction->T_match_query, found, found.translation().norm()))
    support = std::max(support, LoopFollowing::carried(prediction->log_odds, 0.0));
  const bool was_lost = context_.is_one_drive && place && query_.trajectory_point &&
                        session_of(hypothesis.candidate.match) == session_of(query_.frame);
  const LoopEvidence& evidence = hypothesis.geometric->evidence;
  const double lost =
      evidence.in_the_open && !evidence.both_are_narrow ? kUnknownInTheOpen_log_odds : kUnknownOtherwise_log_odds;
  if (options_.follow)
    support += odometry_log_odds(place, query_.trajectory_point, found, evidence, was_lost ? lost : 0.0);
  decide(*hypothesis.geometric, context_.look_alikes_log_odds, support, options_);
  if (options_.follow && hypothesis.geometric->is_consistent())
    hypothesis.geometric->refusal = refuse_heading(place, query_.trajectory_point, found);
  hypothesis.refusal = hypothesis.geometric->refusal;
}

// How the two scans lie to each other as they were taken, from how they would if both stood upright.
Pose CandidateRegistration::from_upright(const Hypothesis& hypothesis, const Pose& T_match_query_upright) const {
  return upright_pose(hypothesis.place->up).inverse() * T_match_query_upright * upright_pose(query_.cloud.up);
}

std::vector<Hypothesis> CandidateRegistration::search_overhead(const Hypothesis& of_place, double yaw_reach_rad,
                                                               std::size_t wanted) {
  const auto found = overhead_.search(*of_place.place, of_place.candidate.yaw_rad, yaw_reach_rad, kReach_m, wanted);
  std::vector<Hypothesis> hypotheses;
  for (std::size_t i = 0; i < found.size(); ++i) {
    Hypothesis& each = hypotheses.emplace_back(of_place);
    each.T_guess_match_query = from_upright(each, planar_pose(found[i].x_m, found[i].y_m, found[i].yaw_rad));
    each.overlap = found[i].overlap;
  }
  return hypotheses;
}

void CandidateRegistration::check_temporal_consistency(Hypothesis& hypothesis) const {
  hypothesis.temporal = check_temporal(query_.frame, hypothesis.candidate.match, context_.query_descriptor,
                                       context_.place_descriptor, context_.parameters.temporal);
  if (!hypothesis.refusal) hypothesis.refusal = hypothesis.temporal.refusal;
}

}  // namespace revisit
