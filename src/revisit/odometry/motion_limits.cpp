// SPDX-License-Identifier: Apache-2.0
#include <revisit/odometry/motion_limits.hpp>

#include <Eigen/Eigenvalues>

namespace revisit {
namespace {

constexpr double kHardlyFixed = 0.1;  // share of all that fixes the position
constexpr double kMostAcceleration_mps2 = 6.0, kJolt_m = 0.1, kMostTurn_deg = 15.0;

// Projects onto the directions that the scan hardly fixes, in its own frame.
Eigen::Matrix3d hardly_fixed(const Matrix6& information) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(information.topLeftCorner<3, 3>());
  const Eigen::Vector3d is_free = (axes.eigenvalues().array() < kHardlyFixed * axes.eigenvalues().sum()).cast<double>();
  return axes.eigenvectors() * is_free.asDiagonal() * axes.eigenvectors().transpose();
}

}  // namespace

MotionLimits::MotionLimits(const Pose& T_map_predicted, double untracked_s)
    : T_map_predicted_(T_map_predicted), most_m_(kJolt_m + 0.5 * kMostAcceleration_mps2 * untracked_s * untracked_s) {}

bool MotionLimits::slides(const IcpResult& found) const {
  return (hardly_fixed(found.information) * surprise(found).translation()).norm() > most_m_;
}

bool MotionLimits::is_near(const IcpResult& found) const {
  const Pose off = surprise(found);
  return off.translation().norm() <= most_m_ && rotation_angle(off) <= to_radians(kMostTurn_deg);
}

}  // namespace revisit
