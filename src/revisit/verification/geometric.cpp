// SPDX-License-Identifier: Apache-2.0
#include <revisit/verification/geometric.hpp>

#include <cstdio>

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
  if (!converged) return "registration did not converge";
  if (evidence.inlier_ratio < options.min_inlier_ratio)
    return format("inlier ratio %.2f below %.2f", evidence.inlier_ratio, options.min_inlier_ratio);
  if (translation_m > options.max_translation_m)
    return format("translation %.1f m above %.1f m", translation_m, options.max_translation_m);
  return {};
}

}  // namespace

GeometricEvidence check_geometric(const SurfaceCloud& match, const SurfaceCloud& query, double yaw_rad,
                                  const GeometricOptions& options) {
  GeometricEvidence best;
  bool best_converged = false;
  const auto consider = [&](const Pose& T_guess_match_query, bool from_features) {
    const IcpResult icp = align_icp(match, query, T_guess_match_query);
    const Agreement agreement = measure_agreement(match, query, icp.T_target_source, options.inlier_distance_m);
    if (best.icp_iterations > 0 && agreement.inlier_ratio <= best.inlier_ratio) return;
    best.T_match_query = icp.T_target_source;
    best.inlier_ratio = agreement.inlier_ratio;
    best.rmse_m = agreement.rmse_m;
    best.icp_iterations = icp.iterations + 1;
    best.from_features = from_features;
    best_converged = icp.converged;
  };
  Pose T_yaw = Pose::Identity();
  T_yaw.linear() = Eigen::AngleAxisd(yaw_rad, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  consider(T_yaw, false);
  if (const auto features = align_features(match, query, options.feature_radius_m)) {
    best.feature_matches = features->matches;
    best.feature_inliers = features->inliers;
    consider(features->T_target_source, true);
  }
  best.reason = reason_to_refuse(best, best_converged, options);
  best.consistent = best.reason.empty();
  return best;
}

}  // namespace revisit
