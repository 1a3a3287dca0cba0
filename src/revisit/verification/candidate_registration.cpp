// SPDX-License-Identifier: Apache-2.0
#include <revisit/verification/candidate_registration.hpp>

#include <algorithm>
#include <cmath>

#include <oneapi/tbb/parallel_for.h>

#include <revisit/core/stopwatch.hpp>
#include <revisit/descriptors/similarity.hpp>
#include <revisit/verification/acceptance.hpp>

namespace revisit {
namespace {

// The overhead search turns in steps of 3 degrees: one more on either side.
const double kYawMargin_rad = to_radians(3.0);

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

Result<std::vector<Hypothesis>> CandidateRegistration::test(std::span<const LoopCandidate> candidates) {
  std::vector<Hypothesis> hypotheses;
  for (const LoopCandidate& candidate : candidates) {
    auto hypothesis = open(candidate);
    if (!hypothesis) return hypothesis.error();
    hypothesis->T_guess_match_query = from_upright(*hypothesis, planar_pose(0, 0, candidate.yaw_rad));
    hypotheses.push_back(*std::move(hypothesis));
  }
  if (options_.overhead_search) {
    const double half_sector_rad = kPi / context_.parameters.descriptor.sectors;
    for (Hypothesis& each : hypotheses) {
      search_overhead(half_sector_rad + kYawMargin_rad, each);
      if (each.overlap < options_.min_overlap)
        each.refusal = Refusal{Refusal::Reason::kLowOverlap, each.overlap, options_.min_overlap};
    }
    std::stable_sort(hypotheses.begin(), hypotheses.end(),
                     [](const Hypothesis& a, const Hypothesis& b) { return a.overlap > b.overlap; });
  }
  hypotheses.resize(std::min(hypotheses.size(), static_cast<std::size_t>(options_.candidates)));

  Stopwatch watch;
  for (Hypothesis& each : hypotheses) check_temporal_consistency(each);
  temporal_ms_ += watch.lap_ms();

  // Each is registered on its own; the order in which they finish does not matter.
  if (std::any_of(hypotheses.begin(), hypotheses.end(), [](const Hypothesis& each) { return !each.refusal; }))
    query_geometry();
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
  search_overhead(kYawMargin_rad, *hypothesis);
  hypothesis->T_guess_match_query = prediction.T_match_query;
  check_temporal_consistency(*hypothesis);
  query_geometry();
  if (!hypothesis->refusal) register_scans(*hypothesis);
  return hypothesis;
}

void CandidateRegistration::register_scans(Hypothesis& hypothesis) const {
  hypothesis.geometry = std::make_shared<ScanGeometry>(*hypothesis.place);
  hypothesis.geometric =
      check_geometric(*hypothesis.geometry, *query_geometry_,
                      {hypothesis.T_guess_match_query, hypothesis.overlap, context_.typical}, options_);
  const double support = context_.following.support_log_odds(
      query_.trajectory_point, context_.places.at(hypothesis.candidate.match), hypothesis.geometric->T_match_query);
  decide(*hypothesis.geometric, support, options_);
  hypothesis.refusal = hypothesis.geometric->refusal;
}

// How the two scans lie to each other as they were taken, from how they would if both stood upright.
Pose CandidateRegistration::from_upright(const Hypothesis& hypothesis, const Pose& T_match_query_upright) const {
  return upright_pose(hypothesis.place->up).inverse() * T_match_query_upright * upright_pose(query_.cloud.up);
}

void CandidateRegistration::search_overhead(double yaw_reach_rad, Hypothesis& hypothesis) {
  const OverheadMatch found =
      overhead_.search(*hypothesis.place, hypothesis.candidate.yaw_rad, yaw_reach_rad, kReach_m);
  hypothesis.T_guess_match_query = from_upright(hypothesis, planar_pose(found.x_m, found.y_m, found.yaw_rad));
  hypothesis.overlap = found.overlap;
}

void CandidateRegistration::check_temporal_consistency(Hypothesis& hypothesis) const {
  hypothesis.temporal = check_temporal(query_.frame, hypothesis.candidate.match, context_.query_descriptor,
                                       context_.place_descriptor, context_.parameters.temporal);
  if (!hypothesis.refusal) hypothesis.refusal = hypothesis.temporal.refusal;
}

}  // namespace revisit
