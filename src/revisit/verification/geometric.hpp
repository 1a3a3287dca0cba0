// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include <revisit/config/parameters.hpp>
#include <revisit/core/loop.hpp>
#include <revisit/registration/feature_alignment.hpp>
#include <revisit/verification/loop_probability.hpp>

namespace revisit {

/// What registration says about a candidate.
struct GeometricEvidence {
  Pose T_match_query = Pose::Identity();     ///< best registration found, accepted or not
  Matrix6 information = Matrix6::Zero();     ///< of the pose, as in LoopConstraint
  LoopEvidence evidence;                     ///< what speaks for it
  double log_odds = 0.0, probability = 0.0;  ///< that follow from it and from the prior
  bool has_converged = false;
  int icp_iterations = 0;
  std::size_t feature_matches = 0, feature_inliers = 0;  ///< FPFH; 0 where it found no transform
  bool from_features = false;  ///< ICP started from FPFH's transform, not from the descriptor's yaw
  bool consistent = false;
  std::string reason;  ///< why not consistent
};

/// What consecutive scans of this sensor show of each other: it hardly gets better than that.
struct UsualAgreement {
  double inlier_ratio = 0.9;            ///< above 0, up to 1; of the last few scans, where that is known
  double intensity_correlation = 0.95;  ///< above 0, up to 1; the median of all
};

/// What is known of a candidate before it is registered.
struct CandidateView {
  /// The yaw that the descriptors agreed on, or the overhead search's pose.
  Pose T_guess_match_query = Pose::Identity();
  double overlap = 0.8;  ///< of both scans seen from overhead; as usual, where nobody looked
  UsualAgreement usual = {};
};

/// Geometric consistency (paper, section III-D): registers the query onto the match by ICP, from the guess; with
/// features_fallback, from FPFH's transform where that is not consistent; with features_first, the other way round.
/// Judges the better of both. Deterministic; one thread a scan.
GeometricEvidence check_geometric(const ScanGeometry& match, const ScanGeometry& query, const CandidateView& view,
                                  const GeometricOptions& options);

/// Judges anew what was registered, with all that makes it likely besides (log odds).
void judge(GeometricEvidence& found, double prior_log_odds, const GeometricOptions& options);

/// Makes the pose of what was accepted as exact as the scans allow: a quarter of the error with 16 lines.
void refine(GeometricEvidence& found, const ScanGeometry& match, const ScanGeometry& query);

}  // namespace revisit
