// SPDX-License-Identifier: Apache-2.0
#include <revisit/pipeline/register_scans.hpp>

#include <algorithm>
#include <optional>
#include <utility>
#include <vector>

#include <oneapi/tbb/parallel_for.h>

#include <revisit/pipeline/prepare.hpp>
#include <revisit/preprocess/undistort.hpp>
#include <revisit/registration/overhead_search.hpp>
#include <revisit/registration/sweep_motion.hpp>
#include <revisit/verification/acceptance.hpp>
#include <revisit/verification/geometric.hpp>

namespace revisit {
namespace {

constexpr double kReach_m = 12.0;   // scans farther apart share too little
constexpr std::size_t kStarts = 6;  // poses from overhead that are registered
// Who asks how two scans lie to each other believes that they show one place; of candidates for a loop nearly all do
// not. In the open the right pose is also far ahead of all others that were tried, and a wrong one is not: the more it
// is ahead, from kBegins to kFar, the more is added (docs/accuracy.md, "Two scans without a guess").
struct Prior {
  static constexpr double kInTheOpen_log_odds = 2.0, kStandingOut_log_odds = 8.0;
  static constexpr double kBegins_log_odds = 8.0, kFar_log_odds = 16.0;  ///< ahead of the likeliest other pose
  /// Rooms fit one another, and themselves turned by 90 degrees.
  static constexpr double kInRooms_log_odds = 3.0;
};
// Of two scans in a row, intensities correlate by .83 (HDL-64E) to .97 (OS0-128); which sensor this is, nobody knows.
constexpr double kTypicalIntensities = 0.85;
constexpr double kOther_m = 1.0, kOther_rad = 0.2;  // poses farther apart exclude each other
constexpr int kRounds = 2;                          // in which the motion of one sweep tells that of the other
constexpr double kHopeless_log_odds = -20.0;        // no motion makes another place the same

struct RegisteredPair {
  ScanGeometry target, source;
  GeometricEvidence found;
};

bool is_other(const Pose& a, const Pose& b) {
  const Pose apart = a.inverse() * b;
  return apart.translation().norm() > kOther_m || rotation_angle(apart) > kOther_rad;
}

CandidateView view_from(const Pose& T_guess_target_source, double overlap) {
  CandidateView view;
  view.T_guess_match_query = T_guess_target_source;
  view.overlap = overlap;
  view.typical.intensity_correlation = kTypicalIntensities;
  return view;
}

// What is known of the best pose without its own evidence. One pose is right at most: what another explains as well
// speaks against this one.
double prior_log_odds(const GeometricEvidence& best, const std::optional<double>& likeliest_other) {
  double prior = Prior::kInRooms_log_odds;
  if (best.evidence.in_the_open) {
    const double ahead = likeliest_other ? best.own_log_odds - *likeliest_other : 0.0;
    prior =
        Prior::kInTheOpen_log_odds +
        Prior::kStandingOut_log_odds *
            std::clamp((ahead - Prior::kBegins_log_odds) / (Prior::kFar_log_odds - Prior::kBegins_log_odds), 0.0, 1.0);
  }
  return likeliest_other ? prior - std::log1p(std::exp(*likeliest_other + prior)) : prior;
}

// Every heading and position seen from overhead; the ones that share most are registered, the surest is the answer.
RegisteredPair register_without_guess(const ThinCloud& target_cloud, const ThinCloud& source_cloud,
                                      const GeometricOptions& options) {
  RegisteredPair pair{ScanGeometry(target_cloud), ScanGeometry(source_cloud), {}};
  OverheadSearch search(source_cloud);
  const auto starts = search.search(target_cloud, 0.0, kPi, kReach_m, kStarts);
  std::vector<GeometricEvidence> found(starts.size());
  tbb::parallel_for(std::size_t{0}, starts.size(), [&](std::size_t i) {
    const Pose T_guess = upright_pose(target_cloud.up).inverse() *
                         planar_pose(starts[i].x_m, starts[i].y_m, starts[i].yaw_rad) * upright_pose(source_cloud.up);
    found[i] = check_geometric(pair.target, pair.source, view_from(T_guess, starts[i].overlap), options);
  });
  GeometricEvidence& best = pair.found = *std::max_element(
      found.begin(), found.end(), [](const auto& a, const auto& b) { return a.own_log_odds < b.own_log_odds; });
  std::optional<double> likeliest_other;
  for (const GeometricEvidence& each : found)
    if (is_other(each.T_match_query, best.T_match_query))
      likeliest_other = std::max(each.own_log_odds, likeliest_other.value_or(each.own_log_odds));
  decide(best, 0.0, prior_log_odds(best, likeliest_other), options);
  return pair;
}

ScanGeometry geometry_without(const Twist& motion, const PreparedScan& scan) {
  ThinCloud cloud = thin_for_registration(compensated(scan.scan, motion), scan.ground.is_ground);
  cloud.up = scan.cloud.up;
  return ScanGeometry(std::move(cloud));
}

// Nobody followed the sensors: at 10 m/s both sweeps are bent by up to a metre. The source's motion is found on the
// target, then the target's on the source without its own, and so once more; both are registered again without either.
// What speaks against the pose besides the two scans stays as it is.
std::optional<RegisteredPair> without_motion(const RegisteredPair& swept, const PreparedScan& target,
                                             const PreparedScan& source, const GeometricOptions& options) {
  const GeometricEvidence& found = swept.found;
  if ((target.scan.times_s.empty() && source.scan.times_s.empty()) || found.own_log_odds < kHopeless_log_odds)
    return std::nullopt;
  const bool in_the_open = found.evidence.in_the_open;
  Pose T_target_source = found.T_match_query;
  std::optional<ScanGeometry> straight_target, straight_source;
  for (int round = 0; round < kRounds; ++round) {
    const SurfaceCloud& on = straight_target ? straight_target->surface() : swept.target.surface();
    const SweepMotion of_source =
        find_sweep_motion(on, source.scan, T_target_source, in_the_open).value_or(SweepMotion{T_target_source, {}});
    straight_source.emplace(geometry_without(of_source.motion, source));
    const Pose T_source_target = of_source.T_target_source.inverse();
    const SweepMotion of_target =
        find_sweep_motion(straight_source->surface(), target.scan, T_source_target, in_the_open)
            .value_or(SweepMotion{T_source_target, {}});
    straight_target.emplace(geometry_without(of_target.motion, target));
    T_target_source = of_target.T_target_source.inverse();
  }
  RegisteredPair straight{*std::move(straight_target), *std::move(straight_source), {}};
  straight.found =
      check_geometric(straight.target, straight.source, view_from(T_target_source, found.evidence.overlap), options);
  decide(straight.found, 0.0, found.log_odds - found.own_log_odds, options);
  return straight;
}

}  // namespace

Result<Registration> register_scans(const Scan& source, const Scan& target, const Parameters& parameters) {
  if (const Status status = validate(parameters); !status) return status.error();
  ScanPreparation preparation(parameters, std::nullopt, {}, {});
  const auto match = preparation.prepare(target), query = preparation.prepare(source);
  for (const auto* each : {&match, &query})
    if (!*each) return each->error();
  RegisteredPair pair = register_without_guess(match->cloud, query->cloud, parameters.geometric);
  if (auto straight = without_motion(pair, *match, *query, parameters.geometric);
      straight && straight->found.own_log_odds > pair.found.own_log_odds)
    pair = *std::move(straight);
  GeometricEvidence& found = pair.found;
  if (found.is_consistent()) refine(found, pair.target, pair.source);
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
