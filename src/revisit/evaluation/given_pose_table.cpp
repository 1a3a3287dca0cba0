// SPDX-License-Identifier: Apache-2.0
#include <revisit/evaluation/given_pose_table.hpp>

#include <cmath>

#include <revisit/evaluation/internal/percentile.hpp>

namespace revisit {

GivenPoseTable evaluate_given_poses(const std::vector<GivenPose>& poses, const Reference& reference, bool is_planar) {
  using evaluation_internal::percentile;
  GivenPoseTable table;
  table.revisits = reference.revisits().size();
  std::vector<double> yaw_deg, plane_m, height_m;
  for (const GivenPose& given : poses) {
    const auto T_truth = reference.T_match_query(given.match, given.query);
    if (!T_truth) continue;
    const double yaw_error_deg = to_degrees(std::abs(wrap_angle(yaw_of(given.T_match_query) - yaw_of(*T_truth))));
    const Eigen::Vector3d off = given.T_match_query.translation() - T_truth->translation();
    const double off_m = is_planar ? off.head<2>().norm() : off.norm();
    const double turned_deg =
        is_planar ? yaw_error_deg : to_degrees(rotation_angle(T_truth->inverse() * given.T_match_query));
    table.right += reference.revisits().contains(given.query) && off_m <= reference.rules().right_translation_m &&
                   turned_deg <= reference.rules().right_rotation_deg;
    if (T_truth->translation().norm() > reference.rules().same_place_m) continue;
    yaw_deg.push_back(yaw_error_deg);
    plane_m.push_back(off.head<2>().norm());
    height_m.push_back(std::abs(off.z()));
  }
  table.answers = yaw_deg.size();
  table.median_yaw_deg = percentile(yaw_deg, 0.5);
  table.p95_yaw_deg = percentile(yaw_deg, 0.95);
  table.median_plane_m = percentile(plane_m, 0.5);
  table.p95_plane_m = percentile(plane_m, 0.95);
  table.median_height_m = percentile(height_m, 0.5);
  table.p95_height_m = percentile(height_m, 0.95);
  return table;
}

}  // namespace revisit
