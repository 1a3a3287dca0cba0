// SPDX-License-Identifier: Apache-2.0
#include <revisit/verification/geometric.hpp>

#include <algorithm>
#include <optional>

#include <revisit/core/text.hpp>
#include <revisit/registration/feature_alignment.hpp>
#include <revisit/registration/icp.hpp>

namespace revisit {
namespace {

std::string reason_to_refuse(const GeometricEvidence& found, const GeometricOptions& options) {
  const LoopEvidence& evidence = found.evidence;
  if (evidence.inlier_ratio < options.min_inlier_ratio)
    return format("inlier ratio %.2f below %.2f", evidence.inlier_ratio, options.min_inlier_ratio);
  if (found.probability < options.min_probability)
    return format("probability %.3f below %.3f (inliers %.2f; free space %.2f; intensity %.2f; rmse %.2f m)",
                  found.probability, options.min_probability, evidence.inlier_ratio, evidence.free_space_agreement,
                  evidence.intensity_agreement.value_or(0.0), evidence.rmse_m);
  if (!found.has_converged) return "registration did not converge";
  if (evidence.distance_m > options.max_translation_m)
    return format("translation %.1f m above %.1f m", evidence.distance_m, options.max_translation_m);
  return {};
}

GeometricEvidence register_from(const SurfaceCloud& match, const SurfaceCloud& query, const CandidateView& view,
                                const GeometricOptions& options) {
  // Good enough to judge; other places are noticed early (docs/accuracy.md, cost).
  const IcpResult icp = align_icp(match, query.points(), view.T_guess_match_query,
                                  {.coarse_m = options.overhead_search ? 2.0 : 4.0,
                                   .settled_m = 1e-3,
                                   .most_iterations = 40,
                                   .least_matched = 0.12});
  const Agreement agreement = measure_agreement(match, query, icp.T_target_source, options.inlier_distance_m);
  GeometricEvidence evidence;
  evidence.T_match_query = icp.T_target_source;
  evidence.icp_iterations = icp.iterations;
  evidence.information = icp.information;
  LoopEvidence& all = evidence.evidence;
  all.inlier_ratio = agreement.inlier_ratio;
  all.inlier_share = agreement.inlier_ratio / view.usual.inlier_ratio;
  all.free_space_agreement = agreement.free_space_agreement;
  if (agreement.intensity_correlation)
    all.intensity_agreement = *agreement.intensity_correlation / view.usual.intensity_correlation;
  all.rmse_m = agreement.rmse_m;
  all.overlap = view.overlap;
  all.horizon = std::min(match.seen().share_of_horizon(), query.seen().share_of_horizon());
  all.distance_m = icp.T_target_source.translation().norm();
  evidence.has_converged = icp.converged;
  judge(evidence, 0.0, options);
  return evidence;
}

}  // namespace

void judge(GeometricEvidence& found, double prior_log_odds, const GeometricOptions& options) {
  found.log_odds = loop_log_odds(found.evidence) + prior_log_odds;
  found.probability = probability_of(found.log_odds);
  found.reason = reason_to_refuse(found, options);
  found.consistent = found.reason.empty();
}

void refine(GeometricEvidence& found, const ScanGeometry& match, const ScanGeometry& query) {
  // Foliage and corners have normals that are off; a narrow kernel leaves them out, while patches are still looked for
  // around.
  constexpr double kMost_m = 0.15, kMost_rad = 0.02;
  const IcpResult icp = align_icp(match.surface(), query.surface().points(), found.T_match_query,
                                  {.coarse_m = 0.25, .fine_m = 0.05, .least_reach_m = 1.0, .settled_m = 1e-3});
  const Pose moved = found.T_match_query.inverse() * icp.T_target_source;
  if (!icp.converged || moved.translation().norm() > kMost_m || rotation_angle(moved) > kMost_rad) return;
  found.T_match_query = icp.T_target_source;
  found.information = icp.information;
}

GeometricEvidence check_geometric(const ScanGeometry& match, const ScanGeometry& query, const CandidateView& view,
                                  const GeometricOptions& options) {
  std::optional<GeometricEvidence> best;
  const auto consider = [&](GeometricEvidence evidence, const std::optional<FeatureAlignment>& features) {
    evidence.from_features = features.has_value();
    const std::size_t matches = features ? features->matches : best ? best->feature_matches : 0;
    const std::size_t inliers = features ? features->inliers : best ? best->feature_inliers : 0;
    if (!best || evidence.consistent || evidence.evidence.inlier_ratio > best->evidence.inlier_ratio) best = evidence;
    best->feature_matches = matches;
    best->feature_inliers = inliers;
  };
  for (const bool from_features : {options.features_first, !options.features_first}) {
    if (best && !options.features_first && !options.features_fallback) break;
    if (from_features) {
      const auto features = align_features(match.surface(), match.features(options.feature_radius_m), query.surface(),
                                           query.features(options.feature_radius_m));
      if (!features) continue;
      CandidateView from = view;
      from.T_guess_match_query = features->T_target_source;
      consider(register_from(match.surface(), query.surface(), from, options), features);
    } else {
      consider(register_from(match.surface(), query.surface(), view, options), std::nullopt);
    }
    if (best->consistent) break;
  }
  return *best;
}

}  // namespace revisit
