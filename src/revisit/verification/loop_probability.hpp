// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <optional>

namespace revisit {

/// What speaks for or against a registered pair of scans showing the same place at the pose that was found.
struct LoopEvidence {
  double inlier_ratio = 0.0;  ///< smaller of both directions
  /// Of what was in sight (Agreement::in_sight_ratio), as a share of what scans lately show of the one before them: in
  /// a field nothing fits well, between shelves everything does.
  double inlier_share = 0.0;
  double hidden_share = 0.0;          ///< larger of both directions (Agreement::hidden_share)
  double free_space_agreement = 0.0;  ///< smaller of both directions
  /// Correlation of intensities, as a share of that between consecutive scans; none where intensities say nothing.
  std::optional<double> intensity_agreement;
  double rmse_m = 0.0;          ///< point-to-plane, over the inliers
  double residual_share = 1.0;  ///< rmse_m, as a share of that between consecutive scans, both in voxels
  double voxel_m = 1.0;     ///< edge of the voxels that the scans were thinned with: what lengths are measured against
  bool in_the_open = true;  ///< SurfaceCloud::is_in_the_open() of either; rooms resemble one another more
  bool one_in_a_room = false;   ///< one scan is of a room, the other in the open
  double overlap = 0.0;         ///< of both scans seen from overhead
  double least_fixed = 0.0;     ///< how well the surfaces fix the direction that they fix least (Agreement): a slide
  std::size_t inliers = 0;      ///< points, smaller of both directions
  bool sensors_differ = false;  ///< in what they can see; what their intensities have in common is not known then
  bool one_is_narrow = false;   ///< one of them sees all round, the other one a sector: the rest can contradict nothing
  bool both_are_narrow = false;  ///< both see less than half of what is around
  double stddev_m = 0.0;         ///< of the position along the direction that is known least, by the pose's information
  double distance_m = 0.0;       ///< between both sensors: farther apart, less fits even at the same place

  /// Where nothing else is known of both scans: a sector of a street may be that of another one.
  bool decides_alone() const { return !one_is_narrow && !(both_are_narrow && in_the_open); }
  /// Rooms and sectors of streets look like other ones for metres: many scans in a row may fit at a wrong place.
  bool resembles_others() const { return both_are_narrow || !in_the_open; }
};

/// The log odds that the pose is right (within 0.5 m and 3 degrees), were right and wrong ones equally many: a logistic
/// model whose coefficients were learnt on recordings that no reported figure uses (docs/accuracy.md says on which and
/// how). Holds for the shipped voxel size and inlier distance. What is known besides is added (Bayes).
double loop_log_odds(const LoopEvidence& evidence);

double probability_of(double log_odds);

}  // namespace revisit
