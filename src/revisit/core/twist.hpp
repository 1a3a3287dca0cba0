// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <revisit/core/pose.hpp>

namespace revisit {

/// A motion that goes on evenly, in the moving sensor's own frame.
struct Twist {
  Eigen::Vector3d linear_mps = Eigen::Vector3d::Zero();
  Eigen::Vector3d angular_radps = Eigen::Vector3d::Zero();

  void archive(auto& fields) { fields(linear_mps, angular_radps); }
};

/// Where the sensor is after `time_s`, seen from where it was: the rotation about the fixed axis, and the translation
/// along the chord, which for the tenths of a second of a sweep is the arc to a millimetre.
inline Pose motion_after(const Twist& twist, double time_s) {
  Pose T = Pose::Identity();
  const Eigen::Vector3d turn = twist.angular_radps * time_s;
  const double angle = turn.norm();
  if (angle > 1e-12) T.linear() = Eigen::AngleAxisd(angle, turn / angle).toRotationMatrix();
  const Eigen::Vector3d straight = twist.linear_mps * time_s;
  T.translation() = straight + 0.5 * turn.cross(straight);
  return T;
}

/// The same motion in another frame of the sensor, turned by `T_new_old`.
inline Twist rotated(const Twist& twist, const Pose& T_new_old) {
  return {T_new_old.linear() * twist.linear_mps, T_new_old.linear() * twist.angular_radps};
}

/// The even motion that leads from one pose to another, `T_before_after`, in `time_s`.
inline Twist twist_of(const Pose& T_before_after, double time_s) {
  const Eigen::AngleAxisd turn(T_before_after.rotation());
  Twist twist;
  twist.angular_radps = turn.angle() * turn.axis() / time_s;
  const Eigen::Vector3d half = 0.5 * turn.angle() * turn.axis();
  // The inverse of v + half x v, to second order.
  const Eigen::Vector3d t = T_before_after.translation();
  twist.linear_mps = (t - half.cross(t) + half.cross(half.cross(t))) / time_s;
  return twist;
}

}  // namespace revisit
