// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>

#include <Eigen/Core>

#include <revisit/core/pose.hpp>

namespace revisit {

/// The planar pose that brings the columns of `from` onto those of `to`, metres: least squares. The identity of none.
inline Pose planar_fit(const Eigen::Matrix2Xf& from, const Eigen::Matrix2Xf& to) {
  if (from.cols() == 0) return Pose::Identity();
  const Eigen::Vector2f mean_from = from.rowwise().mean(), mean_to = to.rowwise().mean();
  const Eigen::Matrix2f cross = (to.colwise() - mean_to) * (from.colwise() - mean_from).transpose();
  const auto yaw_rad = static_cast<double>(std::atan2(cross(1, 0) - cross(0, 1), cross(0, 0) + cross(1, 1)));
  Pose T = planar_pose(0.0, 0.0, yaw_rad);
  T.translation().head<2>() = mean_to.cast<double>() - T.linear().topLeftCorner<2, 2>() * mean_from.cast<double>();
  return T;
}

}  // namespace revisit
