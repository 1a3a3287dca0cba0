// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <optional>

#include <revisit/core/pose.hpp>
#include <revisit/registration/surface_cloud.hpp>

namespace revisit {

struct FeatureAlignment {
  Pose T_target_source = Pose::Identity();
  std::size_t matches = 0;  ///< mutual nearest neighbours among the features
  std::size_t inliers = 0;  ///< of them, in agreement with the transform
};

/// A first rigid transform without any guess (paper, section III-D): FPFH features of the points above ground, mutual
/// nearest neighbours, and the rigid transform that most of them agree on (RANSAC, fixed seed: deterministic).
/// Nothing where fewer than ten matches agree.
std::optional<FeatureAlignment> align_features(const SurfaceCloud& target, const SurfaceCloud& source,
                                               double feature_radius_m);

}  // namespace revisit
