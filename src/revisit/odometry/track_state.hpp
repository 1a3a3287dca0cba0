// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>

#include <revisit/core/pose.hpp>
#include <revisit/core/twist.hpp>
#include <revisit/odometry/imu_trust.hpp>
#include <revisit/odometry/last_view.hpp>
#include <revisit/odometry/scan_match.hpp>
#include <revisit/odometry/velocity_filter.hpp>

namespace revisit {

/// What odometry knows of its way after a scan, beside the map of what it saw. A value: safe to copy and to read from
/// several threads.
struct TrackState {
  static constexpr int kFirstScans = 5;         ///< of a sparse sensor meet few surfaces
  static constexpr int kScansToLearn = 10;      ///< before how well motion is predicted is known
  static constexpr double kSparse_s = 0.25;     ///< a gap after which a prediction is no more than a guess
  static constexpr double kLongestGap_s = 2.0;  ///< beyond, the motion before says nothing about the motion now
  static constexpr double kLongestExtrapolation_s = 5.0;  ///< and is still a better guess than none

  Pose T_odom_lidar = Pose::Identity();  ///< of the last scan
  std::optional<Twist> motion;           ///< there; unknown after a gap
  VelocityFilter velocity;
  double last_stamp_s = 0.0;
  double range_m = 0.0;                      ///< the first scan's median range
  double untracked_m = 0.0;                  ///< what wheels measured since the last scan that was tracked
  Pose T_odom_tracked = Pose::Identity();    ///< of that one
  double tracked_stamp_s = 0.0;              ///< of that one
  double squared_prediction_error_m2 = 0.0;  ///< running mean
  double typical_match = 0.0;                ///< running mean of the share that met the map
  double last_sideways = 0.0;                ///< matched_sideways of the last scan that was tracked
  int scans = 0;                             ///< in the map
  bool start_was_untracked = false;          ///< one of the first five
  ImuTrust imu_trust;                        ///< that it tells turns
  std::uint32_t rings = 0;                   ///< of beams, in which the sensor turns
  LastView last_view;                        ///< of the last scan that was tracked

  /// Goes on to the next scan; the first one (scans == 0) teaches nothing.
  void advance(double stamp_s, const MatcherScan& scan, const ScanMatch& match);
  /// Forgets what the map taught, and the motion; not where it is.
  void restart();
  /// The motion to a scan that was found so far from the one before. Where track is found again, the poses in between
  /// were predicted, and the step from the last one makes up for them.
  Twist motion_found(const Pose& T_previous_lidar, double stamp_s) const;

  void archive(auto& fields) {
    fields(T_odom_lidar, motion, velocity, last_stamp_s, range_m, untracked_m, T_odom_tracked, tracked_stamp_s,
           squared_prediction_error_m2, typical_match, last_sideways, scans, start_was_untracked, imu_trust, rings,
           last_view);
  }

 private:
  void learn(double stamp_s, const ScanMatch& match);
};

}  // namespace revisit
