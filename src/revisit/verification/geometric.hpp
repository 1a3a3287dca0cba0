// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <optional>

#include <revisit/config/parameters.hpp>
#include <revisit/core/loop.hpp>
#include <revisit/core/refusal.hpp>
#include <revisit/registration/scan_geometry.hpp>
#include <revisit/verification/loop_probability.hpp>
#include <revisit/verification/typical_agreement.hpp>

namespace revisit {

/// What is near and what is exact depends on the voxels that two scans were thinned with, the larger of both. The
/// probability was learnt with these shares (docs/accuracy.md), so that they are no parameters.
struct PairScale {
  PairScale(const SurfaceCloud& a, const SurfaceCloud& b)
      : voxel_m(std::max(a.voxel_m(), b.voxel_m())), in_the_open(a.is_in_the_open() || b.is_in_the_open()) {}
  double inlier_distance_m() const { return 0.4 * voxel_m; }  ///< farthest point-to-plane distance of an inlier
  double voxel_m;
  bool in_the_open;
};

/// What registration says about a candidate.
struct GeometricEvidence {
  Pose T_match_query = Pose::Identity();     ///< best registration found, accepted or not
  Matrix6 information = Matrix6::Zero();     ///< of the pose, as in LoopConstraint
  LoopEvidence evidence;                     ///< measures of the registered pair
  double own_log_odds = 0.0;                 ///< of the evidence, in this recording, without the prior
  double log_odds = 0.0, probability = 0.0;  ///< with the prior
  int icp_iterations = 0;
  std::size_t feature_matches = 0, feature_inliers = 0;  ///< FPFH; 0 where it found no transform
  bool from_features = false;      ///< ICP started from FPFH's transform, not from the descriptor's yaw
  std::optional<Refusal> refusal;  ///< absent where it is consistent

  bool is_consistent() const { return !refusal; }
  /// Whether this one scan is enough to know the place. Of a room it must show more, since scans of another building
  /// reach log odds of 5, a few of them 8; where only a sector of it is seen, more still (docs/maps.md).
  bool decides_alone() const {
    const double sure = evidence.both_are_narrow ? kSureInSectors_log_odds : kSureInRooms_log_odds;
    return evidence.decides_alone() && (evidence.in_the_open || own_log_odds >= sure);
  }
  static constexpr double kSureInRooms_log_odds = 6.0, kSureInSectors_log_odds = 8.0;
};

/// What is known of a candidate before it is registered.
struct CandidateView {
  /// The yaw that the descriptors agreed on, or the pose from the overhead search.
  Pose T_guess_match_query = Pose::Identity();
  double overlap = 0.8;  ///< of both scans seen from overhead; a typical value where it was not measured
  TypicalAgreement typical = {};
};

/// Geometric consistency (paper, section III-D): registers the query onto the match by ICP, from the guess or, as
/// `options.features` says, from FPFH's transform, and keeps the better result. Deterministic; one thread a scan.
GeometricEvidence check_geometric(const ScanGeometry& match, const ScanGeometry& query, const CandidateView& view,
                                  const GeometricOptions& options);

/// check_geometric() from the guess alone, with what was seen before each of the scans (ThinCloud::before).
GeometricEvidence check_widened(const ScanGeometry& match, const ScanGeometry& query, const CandidateView& view,
                                const GeometricOptions& options);

/// Makes the pose of what was accepted as exact as the scans allow: a quarter of the error with 16 lines.
void refine(GeometricEvidence& found, const ScanGeometry& match, const ScanGeometry& query);

/// What was found, as a constraint for the pose graph. `score` orders loops (Hypothesis::score()).
LoopConstraint to_loop(FrameId query, FrameId match, const GeometricEvidence& found, double score);

}  // namespace revisit
