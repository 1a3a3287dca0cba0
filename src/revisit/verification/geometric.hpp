// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include <revisit/config/parameters.hpp>
#include <revisit/core/loop.hpp>
#include <revisit/registration/feature_alignment.hpp>

namespace revisit {

/// What registration says about a candidate.
struct GeometricEvidence {
  Pose T_match_query = Pose::Identity();        ///< best registration found, accepted or not
  double inlier_ratio = 0.0;                    ///< smaller of both directions
  double free_space_agreement = 0.0;            ///< smaller of both directions
  std::optional<double> intensity_correlation;  ///< none where intensities are all alike
  double rmse_m = 0.0;
  int icp_iterations = 0;
  std::size_t feature_matches = 0, feature_inliers = 0;  ///< FPFH; 0 where it found no transform
  bool from_features = false;  ///< ICP started from FPFH's transform, not from the descriptor's yaw
  bool consistent = false;
  std::string reason;  ///< why not consistent
};

/// Geometric consistency (paper, section III-D): registers the query onto the match by ICP, from a guess (the
/// yaw that the descriptors agreed on, or what the overhead search found); with features_fallback, from FPFH's
/// transform where that is not consistent; with features_first, the other way round. Judges the better of both.
/// Deterministic; one thread a scan.
GeometricEvidence check_geometric(const ScanGeometry& match, const ScanGeometry& query, const Pose& T_guess_match_query,
                                  const GeometricOptions& options);

}  // namespace revisit
