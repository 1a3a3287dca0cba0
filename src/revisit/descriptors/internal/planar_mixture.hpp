// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <revisit/core/pose.hpp>

namespace revisit::descriptors_internal {

/// Two mixtures of Gaussians in the plane on each other.
struct MixtureAlignment {
  Pose T_target_source = Pose::Identity();
  double correlation = 0.0;  ///< in [0, 1]; 1 where they are the same
};
/// A Gaussian a column: the level (only those of one level meet), centre, covariance (xx, xy, yy), weight. The pose is
/// refined from `T_target_source` on.
MixtureAlignment align_mixtures(const Eigen::MatrixXf& source, const Eigen::MatrixXf& target, Pose T_target_source);

}  // namespace revisit::descriptors_internal
