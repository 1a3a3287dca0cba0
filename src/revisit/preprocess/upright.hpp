// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include <Eigen/Core>

#include <revisit/core/pose.hpp>
#include <revisit/core/scan.hpp>

namespace revisit {

/// Which way is up (a unit vector in the frame of the points): the normal of the ground around the sensor, of up to
/// 40 degrees of tilt. Straight along z where the ground is within 8 degrees of level, as under a car, or is not to be
/// seen. The same points give the same answer.
Eigen::Vector3f find_up(std::span<const Point> points);

/// `up` as it was measured, but straight along z where it is within those 8 degrees.
Eigen::Vector3f unless_level(const Eigen::Vector3f& up);

/// Turns all points about the sensor, in place; left untouched by the identity.
void rotate(std::span<Point> points, const Pose& T_new_old);

}  // namespace revisit
