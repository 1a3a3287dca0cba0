// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include <revisit/core/pose.hpp>
#include <revisit/registration/surface_cloud.hpp>

namespace revisit {

struct FeatureAlignment {
  Pose T_target_source = Pose::Identity();
  std::size_t matches = 0;  ///< mutual nearest neighbours among the features
  std::size_t inliers = 0;  ///< of them, in agreement with the transform
};

/// FPFH features of the points above ground, one column of 33 numbers a point.
struct Features {
  std::vector<std::size_t> points;  ///< indices into the cloud
  Eigen::MatrixXf values;           ///< 33 x points
};
Features compute_features(const SurfaceCloud& cloud, double radius_m);

/// A first rigid transform without any guess (paper, section III-D): FPFH features of the points above ground, mutual
/// nearest neighbours, and the rigid transform that most of them agree on (RANSAC, fixed seed: deterministic).
/// Nothing where fewer than ten matches agree.
std::optional<FeatureAlignment> align_features(const SurfaceCloud& target, const Features& target_features,
                                               const SurfaceCloud& source, const Features& source_features);

}  // namespace revisit
