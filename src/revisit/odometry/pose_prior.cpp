// SPDX-License-Identifier: Apache-2.0
#include <revisit/odometry/pose_prior.hpp>

#include <Eigen/LU>

namespace revisit {
namespace {

constexpr double kWheels_m = 0.02, kWheels = 0.1;  // standard deviation of what they measure

// Along the map's axes; zero where nothing is known.
Eigen::Matrix3d position_information(const TrackState& track, const MatcherScan& scan, double stamp_s,
                                     const ScanMatch& predicted) {
  const double gap_s = stamp_s - track.last_stamp_s;
  if (predicted.measured_m) {
    const double off_m = kWheels_m + kWheels * *predicted.measured_m;
    return Eigen::Matrix3d::Identity() / (off_m * off_m);
  }
  // A start that was not tracked is often misjudged at first, and its speed with it.
  const bool is_misjudged = track.start_was_untracked && track.scans < TrackState::kScansToLearn;
  if (!track.motion || is_misjudged || scan.is_stamp_assumed || gap_s <= 0.0 || gap_s > TrackState::kSparse_s)
    return Eigen::Matrix3d::Zero();
  const Eigen::Matrix3d turn = predicted.T_previous_predicted.linear(), R = track.T_odom_lidar.linear() * turn;
  return R * track.velocity.covariance_after(gap_s, turn).inverse() * R.transpose();
}

}  // namespace

std::optional<PosePrior> pose_prior(const TrackState& track, const MatcherScan& scan, double stamp_s,
                                    const ScanMatch& predicted) {
  PosePrior prior;
  prior.T_target_source = track.T_odom_lidar * predicted.T_previous_predicted;
  prior.position_information = position_information(track, scan, stamp_s, predicted);
  if (predicted.is_turn_measured) {
    const double off_rad = track.imu_trust.stddev_rad();
    prior.rotation_information = Eigen::Matrix3d::Identity() / (off_rad * off_rad);
  }
  if (prior.position_information.isZero() && prior.rotation_information.isZero()) return std::nullopt;
  return prior;
}

}  // namespace revisit
