// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

#include <revisit/core/scan.hpp>

namespace revisit::descriptors_internal {

/// A cube of space, and how flat what lies in it is.
struct SurfaceVoxel {
  Eigen::Vector3i cell;
  Eigen::Vector3f centre = Eigen::Vector3f::Zero();  ///< mean of its points, metres
  Eigen::Vector3f normal = Eigen::Vector3f::Zero();  ///< of unit length where it is flat, else zero
  std::vector<Eigen::Vector3f> points;
  bool is_flat() const { return !normal.isZero(); }
};

/// Cubes with points in them, in the order of their cells. Flat: at least ten points whose smallest variance is below
/// `flat_m2`.
std::vector<SurfaceVoxel> surface_voxels(std::span<const Point> points, float size_m, float flat_m2);

}  // namespace revisit::descriptors_internal
