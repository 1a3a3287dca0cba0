// SPDX-License-Identifier: Apache-2.0
#include <revisit/descriptors/internal/planar_mixture.hpp>

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/LU>

namespace revisit::descriptors_internal {
namespace {

constexpr int kSteps = 5;
constexpr double kFarthest = 16.0;  // squared Mahalanobis distance; what lies farther does not count

struct Gaussian {
  int level;
  Eigen::Vector2d centre;
  Eigen::Matrix2d covariance;
  double weight;
};

Gaussian gaussian_of(const Eigen::MatrixXf& mixture, Eigen::Index i) {
  const Eigen::VectorXd column = mixture.col(i).cast<double>();
  Eigen::Matrix2d covariance;
  covariance << column[3], column[4], column[4], column[5];
  return {static_cast<int>(column[0]), column.segment<2>(1), covariance, column[6]};
}

// What the overlaps of all pairs of one level sum up to, and the step of the pose that makes them overlap more: each
// pair pulls by its share (expectation, then maximisation).
struct Overlap {
  double sum = 0.0;
  Eigen::Matrix3d information = Eigen::Matrix3d::Identity() * 1e-9;
  Eigen::Vector3d pull = Eigen::Vector3d::Zero();
};

Overlap overlap_of(const Eigen::MatrixXf& source, const Eigen::MatrixXf& target, const Pose& T_target_source) {
  const Eigen::Matrix2d R = T_target_source.linear().topLeftCorner<2, 2>();
  const Eigen::Vector2d t = T_target_source.translation().head<2>();
  Overlap overlap;
  for (Eigen::Index i = 0; i < source.cols(); ++i) {
    Gaussian a = gaussian_of(source, i);
    a.centre = R * a.centre + t;
    a.covariance = R * a.covariance * R.transpose();
    for (Eigen::Index j = 0; j < target.cols(); ++j) {
      if (static_cast<int>(target(0, j)) != a.level) continue;
      const Gaussian b = gaussian_of(target, j);
      const Eigen::Matrix2d both = a.covariance + b.covariance;
      const Eigen::Vector2d off = b.centre - a.centre;
      const double determinant = both.determinant();
      const Eigen::Vector2d weighted =
          Eigen::Vector2d(both(1, 1) * off.x() - both(0, 1) * off.y(), both(0, 0) * off.y() - both(0, 1) * off.x()) /
          determinant;
      const double distance = off.dot(weighted);
      if (distance > kFarthest) continue;
      const double share = a.weight * b.weight * std::exp(-distance / 2.0) / std::sqrt(determinant);
      overlap.sum += share;
      Eigen::Matrix<double, 2, 3> jacobian;
      jacobian << 1.0, 0.0, -(a.centre - t).y(), 0.0, 1.0, (a.centre - t).x();
      overlap.information += share * jacobian.transpose() * both.inverse() * jacobian;
      overlap.pull += share * jacobian.transpose() * weighted;
    }
  }
  return overlap;
}

}  // namespace

MixtureAlignment align_mixtures(const Eigen::MatrixXf& source, const Eigen::MatrixXf& target, Pose T_target_source) {
  const double own =
      std::sqrt(overlap_of(source, source, Pose::Identity()).sum * overlap_of(target, target, Pose::Identity()).sum);
  MixtureAlignment best;
  for (int step = 0; step <= kSteps && own > 0.0; ++step) {
    const Overlap overlap = overlap_of(source, target, T_target_source);
    if (overlap.sum / own < best.correlation) break;
    best = {T_target_source, overlap.sum / own};
    const Eigen::Vector3d by = overlap.information.ldlt().solve(overlap.pull);
    const Eigen::Vector3d t = T_target_source.translation();
    T_target_source = planar_pose(t.x() + by.x(), t.y() + by.y(), yaw_of(T_target_source) + by.z());
  }
  return best;
}

}  // namespace revisit::descriptors_internal
