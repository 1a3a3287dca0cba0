// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include <Eigen/Core>

#include <revisit/core/scan.hpp>

namespace revisit::descriptors_internal {

/// The image of Scan Context (Kim and Kim, IROS 2018): 20 rings x 60 sectors up to 80 m, each cell the height of its
/// highest point. As in the authors' program, heights count from a little below the ground, so that cells of bare
/// ground are occupied. The sensor is taken to stand `left_m` to the left of where it was.
Eigen::MatrixXf polar_heights(std::span<const Point> points, double ground_z_m, float left_m = 0.f);

/// 1 / length of each column; 0 of an empty one.
Eigen::VectorXf inverse_lengths(const Eigen::MatrixXf& image);

}  // namespace revisit::descriptors_internal
