// SPDX-License-Identifier: Apache-2.0
#include <revisit/verification/geometric.hpp>

#include <cstdio>
#include <optional>

#include <revisit/registration/feature_alignment.hpp>
#include <revisit/registration/icp.hpp>

namespace revisit {
namespace {

template <typename... Values>
std::string format(const char* pattern, Values... values) {
  char text[128];
  std::snprintf(text, sizeof text, pattern, values...);
  return text;
}

std::string reason_to_refuse(const GeometricEvidence& evidence, bool converged, const GeometricOptions& options) {
  const double translation_m = evidence.T_match_query.translation().norm();
  if (evidence.inlier_ratio < options.min_inlier_ratio)
    return format("inlier ratio %.2f below %.2f", evidence.inlier_ratio, options.min_inlier_ratio);
  if (evidence.free_space_agreement < options.min_free_space_agreement)
    return format("the scans see through each other: agreement %.2f below %.2f", evidence.free_space_agreement,
                  options.min_free_space_agreement);
  if (evidence.intensity_correlation && *evidence.intensity_correlation < options.min_intensity_correlation)
    return format("intensities differ: correlation %.2f below %.2f", *evidence.intensity_correlation,
                  options.min_intensity_correlation);
  if (!converged) return "registration did not converge";
  if (translation_m > options.max_translation_m)
    return format("translation %.1f m above %.1f m", translation_m, options.max_translation_m);
  return {};
}

GeometricEvidence register_from(const SurfaceCloud& match, const SurfaceCloud& query, const Pose& T_guess_match_query,
                                const GeometricOptions& options) {
  const IcpResult icp = align_icp(match, query, T_guess_match_query, options.overhead_search ? 2.0 : 4.0);
  const Agreement agreement = measure_agreement(match, query, icp.T_target_source, options.inlier_distance_m);
  GeometricEvidence evidence;
  evidence.T_match_query = icp.T_target_source;
  evidence.icp_iterations = icp.iterations;
  evidence.inlier_ratio = agreement.inlier_ratio;
  evidence.free_space_agreement = agreement.free_space_agreement;
  evidence.intensity_correlation = agreement.intensity_correlation;
  evidence.rmse_m = agreement.rmse_m;
  evidence.reason = reason_to_refuse(evidence, icp.converged, options);
  evidence.consistent = evidence.reason.empty();
  return evidence;
}

}  // namespace

GeometricEvidence check_geometric(const ScanGeometry& match, const ScanGeometry& query, const Pose& T_guess_match_query,
                                  const GeometricOptions& options) {
  std::optional<GeometricEvidence> best;
  const auto consider = [&](GeometricEvidence evidence, const std::optional<FeatureAlignment>& features) {
    evidence.from_features = features.has_value();
    const std::size_t matches = features ? features->matches : best ? best->feature_matches : 0;
    const std::size_t inliers = features ? features->inliers : best ? best->feature_inliers : 0;
    if (!best || evidence.consistent || evidence.inlier_ratio > best->inlier_ratio) best = evidence;
    best->feature_matches = matches;
    best->feature_inliers = inliers;
  };
  for (const bool from_features : {options.features_first, !options.features_first}) {
    if (best && !options.features_first && !options.features_fallback) break;
    if (from_features) {
      const auto features = align_features(match.surface(), match.features(options.feature_radius_m), query.surface(),
                                           query.features(options.feature_radius_m));
      if (!features) continue;
      consider(register_from(match.surface(), query.surface(), features->T_target_source, options), features);
    } else {
      consider(register_from(match.surface(), query.surface(), T_guess_match_query, options), std::nullopt);
    }
    if (best->consistent) break;
  }
  return *best;
}

}  // namespace revisit
