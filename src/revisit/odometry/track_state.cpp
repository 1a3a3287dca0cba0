// SPDX-License-Identifier: Apache-2.0
#include <revisit/odometry/track_state.hpp>

#include <algorithm>

namespace revisit {

void TrackState::advance(double stamp_s, const MatcherScan& scan, const ScanMatch& match) {
  if (scans == 0)
    range_m = scan.range_m;
  else
    learn(stamp_s, match);
  T_odom_lidar = match.T_odom_lidar;
  last_stamp_s = stamp_s;
  untracked_m = match.is_tracked ? 0.0 : untracked_m + match.measured_m.value_or(0.0);
  if (match.is_tracked) {
    tracked_stamp_s = stamp_s;
    last_sideways = match.icp.matched_sideways;
    last_view.set(scan.map_points, match.T_odom_lidar);
    T_odom_tracked = match.T_odom_lidar;
  }
  start_was_untracked = start_was_untracked || (scans < kFirstScans && !match.is_tracked);
  ++scans;
}

void TrackState::learn(double stamp_s, const ScanMatch& match) {
  constexpr double kNewShare = 0.1;  // of the newest scan in a running mean
  const double share = std::max(kNewShare, 1.0 / scans);
  if (match.is_tracked) {
    squared_prediction_error_m2 +=
        share * (match.prediction_error_m * match.prediction_error_m - squared_prediction_error_m2);
    typical_match += share * (match.icp.matched - typical_match);
    if (match.is_turn_measured) imu_trust.compare(match.T_previous_predicted, match.T_previous_lidar);
  }
  const double gap_s = stamp_s - last_stamp_s;
  if (gap_s <= 0.0 || gap_s > kLongestGap_s) {
    motion.reset();
    velocity = {};
    return;
  }
  velocity.advance(gap_s, match.T_previous_lidar,
                   match.is_tracked ? match.icp.position_information : Eigen::Matrix3d::Zero());
  motion = match.is_tracked ? motion_found(match.T_previous_lidar, stamp_s) : twist_of(match.T_previous_lidar, gap_s);
  motion->linear_mps = velocity.velocity_mps();
}

void TrackState::restart() {
  motion.reset();
  velocity = {};
  squared_prediction_error_m2 = typical_match = last_sideways = 0.0;
  scans = 0;
  start_was_untracked = false;
}

Twist TrackState::motion_found(const Pose& T_previous_lidar, double stamp_s) const {
  const double since_tracked_s = stamp_s - tracked_stamp_s;
  if (since_tracked_s > kLongestGap_s) return twist_of(T_previous_lidar, stamp_s - last_stamp_s);
  return twist_of(normalised(T_odom_tracked.inverse() * T_odom_lidar * T_previous_lidar), since_tracked_s);
}

}  // namespace revisit
