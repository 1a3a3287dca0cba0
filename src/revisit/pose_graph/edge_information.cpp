// SPDX-License-Identifier: Apache-2.0
#include <revisit/pose_graph/edge_information.hpp>

#include <Eigen/LU>

namespace revisit {
namespace {

// Errors as standard deviations, from what simulated drives showed (docs/slam.md).
struct Errors {
  double metres, radians;
};
struct Trust {
  static constexpr Errors kUnmeasured{100.0, 10.0};
  static constexpr Errors kRegistrationSaysNothing{1.0, 0.1};
  static constexpr double kOverconfidence = 3.0;  ///< of registration, in standard deviations
  static Errors odometry(double metres) { return {0.003 + 0.002 * metres, to_radians(0.01 + 0.005 * metres)}; }
  static Errors external_odometry(double metres) { return {0.01 + 0.03 * metres, to_radians(0.05 + 0.1 * metres)}; }
  static Errors loop() { return {0.08, to_radians(0.25)}; }
};

Matrix6 covariance_of(const Errors& errors) {
  Vector6 v;
  v << Eigen::Vector3d::Constant(errors.metres * errors.metres),
      Eigen::Vector3d::Constant(errors.radians * errors.radians);
  return v.asDiagonal();
}

// Without any information of registration the least error is all that is known.
Matrix6 with_least(const Errors& least, const Matrix6& registration) {
  Matrix6 covariance = covariance_of(least);
  if (!registration.isZero())
    covariance += Trust::kOverconfidence * Trust::kOverconfidence *
                  (registration + Matrix6(covariance_of(Trust::kRegistrationSaysNothing).inverse())).inverse();
  const Matrix6 information = covariance.inverse();
  return 0.5 * (information + information.transpose());
}

}  // namespace

Matrix6 odometry_information(const Pose& T_from_to, const Matrix6& registration) {
  return with_least(Trust::odometry(T_from_to.translation().norm()), registration);
}

Matrix6 external_odometry_information(const Pose& T_from_to) {
  return with_least(Trust::external_odometry(T_from_to.translation().norm()), Matrix6::Zero());
}

Matrix6 loop_information(const Matrix6& registration) { return with_least(Trust::loop(), registration); }

// To first order: the error of the first motion as it is seen after the second one, and the second one's own.
Matrix6 chained_information(const Matrix6& of_ab, const Matrix6& of_bc, const Pose& T_b_c) {
  const Eigen::Matrix3d R = T_b_c.linear().transpose();
  const Eigen::Vector3d t = T_b_c.translation();
  Eigen::Matrix3d cross;
  cross << 0.0, -t.z(), t.y(), t.z(), 0.0, -t.x(), -t.y(), t.x(), 0.0;
  Matrix6 seen_from_c = Matrix6::Zero();
  seen_from_c.topLeftCorner<3, 3>() = R;
  seen_from_c.topRightCorner<3, 3>() = -R * cross;
  seen_from_c.bottomRightCorner<3, 3>() = R;
  const Matrix6 covariance = seen_from_c * of_ab.inverse() * seen_from_c.transpose() + of_bc.inverse();
  const Matrix6 information = covariance.inverse();
  return 0.5 * (information + information.transpose());
}

Matrix6 no_information() { return covariance_of(Trust::kUnmeasured).inverse(); }

}  // namespace revisit
