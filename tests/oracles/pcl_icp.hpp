// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <revisit/core/pose.hpp>
#include <revisit/registration/surface_cloud.hpp>

/// PCL's registrations of the same clouds, for tests and benchmarks: its headers, compiled once.
namespace revisit::oracles {

/// T_target_source by point-to-plane ICP between the points that have a normal, from `T_guess`; pairs up to
/// `reach_m` apart.
Pose pcl_point_to_plane(const SurfaceCloud& target, const SurfaceCloud& source, const Pose& T_guess, double reach_m,
                        int most_iterations);

/// T_target_source by generalised ICP, from the identity; pairs up to `reach_m` apart.
Pose pcl_generalised_icp(const SurfaceCloud& target, const SurfaceCloud& source, double reach_m);

}  // namespace revisit::oracles
