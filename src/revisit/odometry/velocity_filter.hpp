// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <revisit/core/pose.hpp>

namespace revisit {

/// A Kalman filter of the sensor's velocity, metres a second in its own frame: scans tell it along the directions that
/// they fix, and along the others it goes on as it was, until they do. Not of turns: a hand that shakes a sensor turns
/// it as no filter foresees. Belongs to one thread at a time.
class VelocityFilter {
 public:
  /// Covariance of the position so much later, m2, in the frame of the sensor, which has turned by so much.
  Eigen::Matrix3d covariance_after(double time_s, const Eigen::Matrix3d& R_before_now) const;
  /// So much later the sensor was found there from where it was before. `information`: inverse covariance of its
  /// position in its own frame, by the scan alone; zero where the pose is only predicted.
  void advance(double time_s, const Pose& T_before_now, const Eigen::Matrix3d& information);
  const Eigen::Vector3d& velocity_mps() const { return velocity_mps_; }
  void archive(auto& fields) { fields(velocity_mps_, of_position_, of_both_, of_velocity_); }

 private:
  void predict(double time_s, const Eigen::Matrix3d& R_before_now);

  static constexpr double kFast_mps = 15.0;  ///< before anything is known
  Eigen::Vector3d velocity_mps_ = Eigen::Vector3d::Zero();
  // Covariances in the sensor's frame: m2, m2/s, m2/s2.
  Eigen::Matrix3d of_position_ = Eigen::Matrix3d::Zero(), of_both_ = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d of_velocity_ = kFast_mps * kFast_mps * Eigen::Matrix3d::Identity();
};

}  // namespace revisit
