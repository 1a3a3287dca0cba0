// SPDX-License-Identifier: Apache-2.0
#include <revisit/pipeline/register_scans.hpp>

#include <algorithm>
#include <vector>

#include <oneapi/tbb/parallel_for.h>

#include <revisit/pipeline/prepare.hpp>
#include <revisit/registration/overhead_search.hpp>
#include <revisit/verification/acceptance.hpp>
#include <revisit/verification/geometric.hpp>

namespace revisit {
namespace {

constexpr double kReach_m = 12.0;   // scans farther apart share too little
constexpr std::size_t kStarts = 6;  // poses from overhead that are registered
// Who asks how two scans lie to each other believes that they show one place; of candidates for a loop nearly all do
// not. Rooms fit one another, and themselves turned by 90 degrees.
constexpr double kPrior_log_odds = 9.0, kPriorOfRooms_log_odds = 3.0;
// Of two scans in a row, intensities correlate by .83 (HDL-64E) to .97 (OS0-128); which sensor this is, nobody knows.
constexpr double kTypicalIntensities = 0.85;
constexpr double kOther_m = 1.0, kOther_rad = 0.2;  // poses farther apart exclude each other

bool is_other(const Pose& a, const Pose& b) {
  const Pose apart = a.inverse() * b;
  return apart.translation().norm() > kOther_m || rotation_angle(apart) > kOther_rad;
}

// Every heading and position seen from overhead; the ones that share most are registered, the surest is the answer.
GeometricEvidence register_without_guess(const ThinCloud& target_cloud, const ThinCloud& source_cloud,
                                         const ScanGeometry& target, const ScanGeometry& source,
                                         const GeometricOptions& options) {
  OverheadSearch search(source_cloud);
  const auto starts = search.search(target_cloud, 0.0, kPi, kReach_m, kStarts);
  const double prior =
      PairScale(target.surface(), source.surface()).in_the_open ? kPrior_log_odds : kPriorOfRooms_log_odds;
  std::vector<GeometricEvidence> found(starts.size());
  tbb::parallel_for(std::size_t{0}, starts.size(), [&](std::size_t i) {
    CandidateView view;
    view.T_guess_match_query = upright_pose(target_cloud.up).inverse() *
                               planar_pose(starts[i].x_m, starts[i].y_m, starts[i].yaw_rad) *
                               upright_pose(source_cloud.up);
    view.overlap = starts[i].overlap;
    view.typical.intensity_correlation = kTypicalIntensities;
    found[i] = check_geometric(target, source, view, options);
  });
  GeometricEvidence best = *std::max_element(
      found.begin(), found.end(), [](const auto& a, const auto& b) { return a.own_log_odds < b.own_log_odds; });
  // One pose is right at most: what another explains as well speaks against this one.
  double others = 0.0;
  for (const GeometricEvidence& each : found)
    if (is_other(each.T_match_query, best.T_match_query))
      others = std::max(others, std::exp(each.own_log_odds + prior));
  decide(best, 0.0, prior - std::log1p(others), options);
  return best;
}

}  // namespace

Result<Registration> register_scans(const Scan& source, const Scan& target, const Parameters& parameters) {
  if (const Status status = validate(parameters); !status) return status.error();
  ScanPreparation preparation(parameters, std::nullopt, {}, {});
  const auto place = preparation.prepare(target), query = preparation.prepare(source);
  for (const auto* each : {&place, &query})
    if (!*each) return each->error();
  const ScanGeometry match(place->cloud), scan(query->cloud);
  GeometricEvidence found = register_without_guess(place->cloud, query->cloud, match, scan, parameters.geometric);
  if (found.is_consistent()) refine(found, match, scan);
  Registration result;
  result.refusal = found.refusal;
  result.T_target_source = found.T_match_query;
  result.information = found.information;
  result.probability = found.probability;
  result.inlier_ratio = found.evidence.inlier_ratio;
  result.rmse_m = found.evidence.rmse_m;
  return result;
}

}  // namespace revisit
