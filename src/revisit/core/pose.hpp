// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>

#include <Eigen/Geometry>

#include <revisit/core/ids.hpp>

namespace revisit {

/// A rigid transform. `T_a_b` maps coordinates of frame b into frame a; products chain by name.
using Pose = Eigen::Isometry3d;

inline constexpr double kPi = 3.14159265358979323846;
inline double to_degrees(double rad) { return rad * 180.0 / kPi; }
inline double to_radians(double deg) { return deg * kPi / 180.0; }

/// The same angle in [-pi, pi).
inline double wrap_angle(double rad) {
  const double turned = std::fmod(rad + kPi, 2.0 * kPi);
  return (turned < 0.0 ? turned + 2.0 * kPi : turned) - kPi;
}

/// The angle of the rotation, radians in [0, pi].
inline double rotation_angle(const Pose& T) { return Eigen::AngleAxisd(T.rotation()).angle(); }

using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Vector6 = Eigen::Matrix<double, 6, 1>;

/// The rigid transform of a small motion: metres, then a rotation vector in radians. To first order in the rotation.
inline Pose small_motion(const Vector6& xi) {
  Pose T = Pose::Identity();
  const double angle = xi.tail<3>().norm();
  if (angle > 1e-12) T.linear() = Eigen::AngleAxisd(angle, xi.tail<3>() / angle).toRotationMatrix();
  T.translation() = xi.head<3>();
  return T;
}

/// The same transform with a rotation that is orthonormal to the last bit that rounding allows. Wherever poses are made
/// from poses, step after step: deviations would grow, by inverses even exponentially.
inline Pose normalised(Pose T) {
  T.linear() = Eigen::Quaterniond(T.linear()).normalized().toRotationMatrix();
  return T;
}

/// Heading of the x axis seen from above, radians.
inline double yaw_of(const Pose& T) { return std::atan2(T.linear()(1, 0), T.linear()(0, 0)); }

/// At (x, y), turned about the vertical: the pose that has this heading.
inline Pose planar_pose(double x_m, double y_m, double yaw_rad) {
  Pose T = Pose::Identity();
  T.linear() = Eigen::AngleAxisd(yaw_rad, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  T.translation() << x_m, y_m, 0.0;
  return T;
}

/// The rotation that turns `up` (of unit length) to z and the heading as little as it can: into a frame that
/// stands upright in the same place. Exactly the identity where up is z.
inline Pose upright_pose(const Eigen::Vector3f& up) {
  Pose T_upright_lidar = Pose::Identity();
  const Eigen::Vector3d axis = up.cast<double>().cross(Eigen::Vector3d::UnitZ());  // length: the sine of the tilt
  if (const double sine = axis.norm(); sine > 0.0)
    T_upright_lidar.linear() = Eigen::AngleAxisd(std::atan2(sine, up.z()), axis / sine).toRotationMatrix();
  else if (up.z() < 0.f)  // upside down: about x, of all the ways there are
    T_upright_lidar.linear() = Eigen::Vector3d(1.0, -1.0, -1.0).asDiagonal();
  return T_upright_lidar;
}

/// Poses of the LiDAR at scan time, by frame; a frame without an entry has no known pose.
struct Trajectory {
  struct Entry {
    double stamp_s = 0.0;
    Pose T_world_lidar = Pose::Identity();
  };
  std::map<FrameId, Entry> entries;

  std::optional<Pose> at(FrameId frame) const {
    const auto found = entries.find(frame);
    if (found == entries.end()) return std::nullopt;
    return found->second.T_world_lidar;
  }
  bool empty() const { return entries.empty(); }
};

}  // namespace revisit
