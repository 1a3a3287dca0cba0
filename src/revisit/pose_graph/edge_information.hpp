// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <revisit/core/pose.hpp>

namespace revisit {

/// How far the graph trusts a measurement: information matrices as in LoopConstraint. Registration takes every point
/// for an independent measurement and is off by more than it says, so that a least error is added (docs/slam.md).

/// Of the motion between two key frames, `T_from_to`; `registration` is the information of the last scan in it.
Matrix6 odometry_information(const Pose& T_from_to, const Matrix6& registration);
/// The same of an external odometry of unknown quality: wheels, for instance, which slip.
Matrix6 external_odometry_information(const Pose& T_from_to);
Matrix6 loop_information(const Matrix6& registration);
/// Of the motion T_a_b and then T_b_c, where both were measured.
Matrix6 chained_information(const Matrix6& of_ab, const Matrix6& of_bc, const Pose& T_b_c);
/// Of a motion that was not measured.
Matrix6 no_information();

}  // namespace revisit
