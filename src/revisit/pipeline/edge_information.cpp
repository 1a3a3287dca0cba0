// SPDX-License-Identifier: Apache-2.0
#include <revisit/pipeline/edge_information.hpp>

#include <Eigen/LU>

namespace revisit {
namespace {

// The covariance that is left where registration says nothing: metres, radians.
constexpr double kNothing_m = 1.0, kNothing_rad = 0.1;
constexpr double kOverconfidence = 3.0;  // of its standard deviations

Matrix6 diagonal(double metres, double radians) {
  Vector6 v;
  v << Eigen::Vector3d::Constant(metres * metres), Eigen::Vector3d::Constant(radians * radians);
  return v.asDiagonal();
}

Matrix6 with_at_least(const Matrix6& registration, double metres, double radians) {
  Matrix6 covariance = diagonal(metres, radians);
  // Without any information the least is all that is known.
  if (!registration.isZero())
    covariance += kOverconfidence * kOverconfidence *
                  (registration + Matrix6(diagonal(kNothing_m, kNothing_rad).inverse())).inverse();
  const Matrix6 information = covariance.inverse();
  return 0.5 * (information + information.transpose());
}

}  // namespace

Matrix6 odometry_information(const Pose& T_from_to, const Matrix6& registration) {
  const double way_m = T_from_to.translation().norm();
  return with_at_least(registration, 0.003 + 0.002 * way_m, to_radians(0.01 + 0.005 * way_m));
}

Matrix6 external_odometry_information(const Pose& T_from_to) {
  const double way_m = T_from_to.translation().norm();
  return with_at_least(Matrix6::Zero(), 0.01 + 0.03 * way_m, to_radians(0.05 + 0.1 * way_m));
}

Matrix6 loop_information(const Matrix6& registration) { return with_at_least(registration, 0.08, to_radians(0.25)); }

Matrix6 no_information() { return diagonal(100.0, 10.0).inverse(); }

}  // namespace revisit
