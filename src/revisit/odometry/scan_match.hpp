// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include <revisit/core/pose.hpp>
#include <revisit/registration/icp.hpp>

namespace revisit {

/// A scan thinned for matching, in its own frame.
struct MatcherScan {
  std::vector<Eigen::Vector3f> points;      ///< one a voxel of the map: what is matched
  std::vector<Eigen::Vector3f> map_points;  ///< eight a voxel at most: what enters the map
  double voxel_m = 1.0, range_m = 10.0;     ///< edge of a voxel; the median range
  bool is_stamp_assumed = false;            ///< it may have been taken longer after the one before than its stamp says
};

/// The motion since the scan before: where the search begins, and the answer where the map gives none.
struct MotionGuess {
  /// What of it was measured: all, by wheels or another odometry; the turn alone, by an IMU; nothing.
  enum class Measured : std::uint8_t { kAll, kTurn, kNothing };
  Pose T_previous_lidar = Pose::Identity();
  Measured measured = Measured::kAll;
};

/// Where one scan was matched.
struct ScanMatch {
  Pose T_odom_lidar = Pose::Identity();          ///< at the scan's stamp; the first scan is the origin
  Pose T_previous_lidar = Pose::Identity();      ///< motion since the scan before
  Pose T_previous_found = Pose::Identity();      ///< the same as registration has it, believed or not
  Pose T_previous_predicted = Pose::Identity();  ///< as it was expected
  Pose T_previous_start = Pose::Identity();      ///< and where registration began
  Matrix6 information = Matrix6::Zero();         ///< of T_previous_lidar, as in LoopConstraint
  IcpResult icp;                                 ///< of the scan with the map, believed or not
  double prediction_error_m = 0.0;               ///< of a point at the median range
  std::optional<double> measured_m;              ///< what wheels say the sensor moved
  bool is_turn_measured = false;                 ///< an IMU says how T_previous_predicted is turned
  bool is_tracked = false;                       ///< otherwise the pose is the predicted one
};

}  // namespace revisit
