// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include <Eigen/Core>

#include <revisit/registration/surface_cloud.hpp>

namespace revisit::registration_internal {

/// FPFH features of the points above ground (`points` indexes the cloud), one column of 33 numbers a point.
struct Features {
  std::vector<std::size_t> points;
  Eigen::MatrixXf values;  ///< 33 x points
};

Features compute_fpfh(const SurfaceCloud& cloud, double radius_m);

}  // namespace revisit::registration_internal
