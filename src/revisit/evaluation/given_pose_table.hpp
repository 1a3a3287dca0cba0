// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include <revisit/evaluation/reference.hpp>

namespace revisit {

/// How a method says that the query lies to the place it answers; no threshold says whether it is sure.
struct GivenPose {
  FrameId query, match;
  Pose T_match_query = Pose::Identity();
};

/// What answers of retrieval say of the pose.
struct GivenPoseTable {
  std::size_t revisits = 0;
  std::size_t right = 0;    ///< revisits whose pose is within right_translation_m and right_rotation_deg of the truth,
                            ///< though the match may be more than same_place_m away
  std::size_t answers = 0;  ///< right by the place (same_place_m): the errors below are theirs
  double median_yaw_deg = 0.0, p95_yaw_deg = 0.0;    ///< heading
  double median_plane_m = 0.0, p95_plane_m = 0.0;    ///< horizontally, in the frame of the match
  double median_height_m = 0.0, p95_height_m = 0.0;  ///< along its z
};

/// `is_planar`: only the heading and the place in the plane are given, and judged.
GivenPoseTable evaluate_given_poses(const std::vector<GivenPose>& poses, const Reference& reference, bool is_planar);

}  // namespace revisit
