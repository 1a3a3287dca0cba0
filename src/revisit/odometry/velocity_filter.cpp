// SPDX-License-Identifier: Apache-2.0
#include <revisit/odometry/velocity_filter.hpp>

#include <Eigen/LU>

#include <revisit/core/twist.hpp>

namespace revisit {
namespace {

// After a second a velocity is another by so much (a standard deviation): cars brake, and hands sway.
constexpr double kChange_mps = 2.0;
constexpr double kLeastVariance_m2 = 1e-6;

}  // namespace

void VelocityFilter::predict(double time_s, const Eigen::Matrix3d& R_before_now) {
  const Eigen::Matrix3d R = R_before_now.transpose();
  of_velocity_.diagonal().array() += time_s * kChange_mps * kChange_mps;
  of_position_ += time_s * (of_both_ + of_both_.transpose()) + time_s * time_s * of_velocity_;
  of_position_.diagonal().array() += kLeastVariance_m2;
  of_both_ += time_s * of_velocity_;
  of_position_ = (R * of_position_ * R.transpose()).eval();
  of_both_ = (R * of_both_).eval();  // a velocity that goes on evenly turns with the sensor
}

Eigen::Matrix3d VelocityFilter::covariance_after(double time_s, const Eigen::Matrix3d& R_before_now) const {
  VelocityFilter then = *this;
  then.predict(time_s, R_before_now);
  return then.of_position_;
}

void VelocityFilter::advance(double time_s, const Pose& T_before_now, const Eigen::Matrix3d& information) {
  predict(time_s, T_before_now.linear());
  const Eigen::Matrix3d before = of_position_.inverse();
  const Eigen::Matrix3d gain = (before * of_both_).transpose();  // of the velocity, by what the position changes
  const Eigen::Matrix3d after = (before + information).inverse();
  velocity_mps_ += gain * time_s * (twist_of(T_before_now, time_s).linear_mps - velocity_mps_);
  of_velocity_ -= gain * (of_position_ - after) * gain.transpose();
  of_both_ = (after * before * of_both_).eval();
  of_position_ = after;
}

}  // namespace revisit
