// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <revisit/descriptors/baseline.hpp>

namespace revisit::descriptors_internal {

/// By how many columns of a circle the place is turned against the query, and how alike they are then: column j of the
/// query lies on column j + columns of the place.
struct Turn {
  double similarity = 0.0;
  Eigen::Index columns = 0;
  Pose T_place_query(Eigen::Index of_circle) const {
    return planar_pose(0.0, 0.0, wrap_angle(2.0 * kPi * static_cast<double>(columns) / static_cast<double>(of_circle)));
  }
};

std::unique_ptr<Baseline> make_paper_isc();
std::unique_ptr<Baseline> make_published_isc();
std::unique_ptr<Baseline> make_scan_context(std::size_t nearest_ring_keys);  ///< 0: every place is compared
std::unique_ptr<Baseline> make_scan_context_pp();
std::unique_ptr<Baseline> make_m2dp();
std::unique_ptr<Baseline> make_glarot3d();
std::unique_ptr<Baseline> make_lidar_iris();
std::unique_ptr<Baseline> make_landmark_density();
std::unique_ptr<Baseline> make_ring();
std::unique_ptr<Baseline> make_ring_pp();
std::unique_ptr<Baseline> make_contour_context();
std::unique_ptr<Baseline> make_stable_triangle();
std::unique_ptr<Baseline> make_binary_triangle();
std::unique_ptr<Baseline> make_solid();

}  // namespace revisit::descriptors_internal
