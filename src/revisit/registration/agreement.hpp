// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include <revisit/core/pose.hpp>
#include <revisit/registration/surface_cloud.hpp>

namespace revisit {

/// How well a relative pose explains both scans.
struct Agreement {
  double inlier_ratio = 0.0;    ///< smaller of both directions: share of the points above ground with a surface within
                                ///< reach, among those within the view of the other scan
  double in_sight_ratio = 0.0;  ///< the same without hidden points: those behind what the other scan saw
  double hidden_share = 0.0;    ///< larger of both directions: share of hidden points among those within the view
  double free_space_agreement = 0.0;  ///< smaller of both directions: inliers among these and the points that stand
                                      ///< where the other scan saw through
  std::optional<double> intensity_correlation;  ///< of ranks; smaller of both directions, of inliers and the points
                                                ///< they lie on; none where intensities are all alike
  double rmse_m = 0.0;                          ///< point-to-plane, over the inliers above ground of both directions
  /// How well the inliers' surfaces fix the position in the horizontal direction that they fix least: the mean square
  /// of their normals along it, in [0, 0.5]. Along a bare wall 0: a pose may slide there.
  double least_fixed = 0.0;
  std::size_t inliers = 0;  ///< smaller of both directions
};
Agreement measure_agreement(const SurfaceCloud& target, const SurfaceCloud& source, const Pose& T_target_source,
                            double inlier_distance_m);

}  // namespace revisit
