// SPDX-License-Identifier: Apache-2.0
#include <revisit/verification/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <optional>

#include <revisit/registration/agreement.hpp>
#include <revisit/registration/feature_alignment.hpp>
#include <revisit/registration/icp.hpp>
#include <revisit/verification/acceptance.hpp>

namespace revisit {
namespace {

// Docs/method.md, section 7, says how each was chosen.
struct Registration {
  // Kernel widths in voxels. A start from a heading alone may be metres off, one from the overhead search hardly.
  static constexpr double kCoarse = 2.0, kCoarseFromHeading = 4.0, kFine = 0.5;
  // Good enough to judge; other places are noticed early (docs/accuracy.md, cost).
  static constexpr double kSettled_m = 1e-3, kLeastMatched = 0.12;
  static constexpr int kMostIterations = 100;      ///< after 60 one accepted pose in 345 had not converged, 0.6 m off
  static constexpr double kFeatureRadius_m = 3.0;  ///< neighbourhood of an FPFH feature
};

// Foliage and corners have normals that are off; a narrow kernel leaves them out, while patches are still looked for
// around. What moves farther was not accepted for where it ends.
struct Refinement {
  static constexpr double kCoarse_m = 0.25, kFine_m = 0.05, kReach_m = 1.0, kSettled_m = 1e-3;
  static constexpr double kMost_m = 0.15, kMost_rad = 0.02;
};

// Two sensors that see another part of a place each: by how far down they see, for the ground at its feet a sensor
// always sees, and by how far up.
struct Differing {
  static constexpr double kDown = 1.5, kDownALittle = 1.15, kUp = 3.0;  ///< ratios of slopes
  static constexpr float kNarrower_rad = 1.05f;                         ///< of the sectors that they see
  /// Of what fits between two scans of one sensor, and of its residual: each thins what it sees by where its own lines
  /// lie.
  static constexpr double kShare = 0.8, kResidual = 1.13;
};

bool sensors_differ(const SensorView& a, const SensorView& b) {
  const auto ratio = [](double x, double y) {
    const double less = std::min(x, y), more = std::max(x, y);
    return less > 0.0 ? more / less : 1.0;
  };
  const double down = ratio(-a.least_slope, -b.least_slope), up = ratio(a.greatest_slope, b.greatest_slope);
  return down > Differing::kDown || (down > Differing::kDownALittle && up > Differing::kUp);
}

GeometricEvidence register_from(const SurfaceCloud& match, const SurfaceCloud& query, const CandidateView& view,
                                const GeometricOptions& options) {
  const PairScale scale(match, query);
  const double coarse = options.overhead_search ? Registration::kCoarse : Registration::kCoarseFromHeading;
  const IcpResult icp = align_icp(match, query.points(), view.T_guess_match_query,
                                  {.coarse_m = coarse * scale.voxel_m,
                                   .fine_m = Registration::kFine * scale.voxel_m,
                                   .settled_m = Registration::kSettled_m,
                                   .most_iterations = Registration::kMostIterations,
                                   .least_matched = Registration::kLeastMatched});
  const Agreement agreement = measure_agreement(match, query, icp.T_target_source, scale.inlier_distance_m());
  GeometricEvidence evidence;
  evidence.T_match_query = icp.T_target_source;
  evidence.icp_iterations = icp.iterations;
  evidence.information = icp.information;
  LoopEvidence& all = evidence.evidence;
  all.inlier_ratio = agreement.inlier_ratio;
  all.sensors_differ = sensors_differ(match.view(), query.view());
  const SeenSpace::Sector &one = match.view().sector, &other = query.view().sector;
  all.one_is_narrow =
      (one.is_narrow() || other.is_narrow()) && std::abs(one.width_rad - other.width_rad) > Differing::kNarrower_rad;
  all.both_are_narrow = one.is_narrow() && other.is_narrow();
  all.inlier_share =
      agreement.in_sight_ratio / (view.typical.in_sight_ratio * (all.sensors_differ ? Differing::kShare : 1.0));
  all.hidden_share = agreement.hidden_share;
  all.free_space_agreement = agreement.free_space_agreement;
  if (agreement.intensity_correlation)
    all.intensity_agreement = *agreement.intensity_correlation / view.typical.intensity_correlation;
  all.rmse_m = agreement.rmse_m;
  all.voxel_m = scale.voxel_m;
  all.residual_share =
      all.rmse_m / scale.voxel_m / (view.typical.residual * (all.sensors_differ ? Differing::kResidual : 1.0));
  all.in_the_open = scale.in_the_open;
  all.one_in_a_room = match.is_in_the_open() != query.is_in_the_open();
  all.least_fixed = agreement.least_fixed;
  all.inliers = agreement.inliers;
  all.stddev_m = largest_stddev_m(icp.information);
  all.overlap = view.overlap;
  all.distance_m = icp.T_target_source.translation().norm();
  decide(evidence, 0.0, 0.0, options);
  return evidence;
}

}  // namespace

GeometricEvidence check_widened(const ScanGeometry& match, const ScanGeometry& query, const CandidateView& view,
                                const GeometricOptions& options) {
  return register_from(match.widened(), query.widened(), view, options);
}

void refine(GeometricEvidence& found, const ScanGeometry& match, const ScanGeometry& query) {
  const IcpResult icp = align_icp(match.surface(), query.surface().points(), found.T_match_query,
                                  {.coarse_m = Refinement::kCoarse_m,
                                   .fine_m = Refinement::kFine_m,
                                   .least_reach_m = Refinement::kReach_m,
                                   .settled_m = Refinement::kSettled_m});
  const Pose moved = found.T_match_query.inverse() * icp.T_target_source;
  if (!icp.converged || moved.translation().norm() > Refinement::kMost_m ||
      rotation_angle(moved) > Refinement::kMost_rad)
    return;
  found.T_match_query = icp.T_target_source;
  found.information = icp.information;
}

LoopConstraint to_loop(FrameId query, FrameId match, const GeometricEvidence& found, double score) {
  return {query,
          match,
          found.T_match_query,
          found.evidence.inlier_ratio,
          found.evidence.rmse_m,
          found.probability,
          score,
          found.information,
          found.own_log_odds,
          found.evidence.in_the_open};
}

GeometricEvidence check_geometric(const ScanGeometry& match, const ScanGeometry& query, const CandidateView& view,
                                  const GeometricOptions& options) {
  std::optional<GeometricEvidence> best;
  const auto consider = [&](GeometricEvidence evidence, const std::optional<FeatureAlignment>& features) {
    evidence.from_features = features.has_value();
    const std::size_t matches = features ? features->matches : best ? best->feature_matches : 0;
    const std::size_t inliers = features ? features->inliers : best ? best->feature_inliers : 0;
    if (!best || evidence.is_consistent() || evidence.evidence.inlier_ratio > best->evidence.inlier_ratio)
      best = evidence;
    best->feature_matches = matches;
    best->feature_inliers = inliers;
  };
  const bool features_first = options.features == "first";
  for (const bool from_features : {features_first, !features_first}) {
    if (best && options.features == "never") break;
    if (from_features) {
      const auto features = align_features(match.surface(), match.features(Registration::kFeatureRadius_m),
                                           query.surface(), query.features(Registration::kFeatureRadius_m));
      if (!features) continue;
      CandidateView from = view;
      from.T_guess_match_query = features->T_target_source;
      consider(register_from(match.surface(), query.surface(), from, options), features);
    } else {
      consider(register_from(match.surface(), query.surface(), view, options), std::nullopt);
    }
    if (best->is_consistent()) break;
  }
  return *best;
}

}  // namespace revisit
