// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <optional>

#include <Eigen/Core>

#include <revisit/core/pose.hpp>
#include <revisit/core/scan.hpp>

namespace revisit {

/// Which way is up, from an IMU and odometry: what the accelerometer felt over the last seconds, less how odometry
/// moved meanwhile, is gravity. Braking and bends do not turn it, as they turn what an accelerometer feels alone; what
/// is left is the accelerometer's own error, which turns with the sensor. Belongs to one thread at a time.
class GravityTrack {
 public:
  /// A scan with its readings, and where odometry had the sensor at `stamp_s`, which increases.
  void add(const Scan& scan, double stamp_s, const Pose& T_odom_lidar);
  /// The next scan has nothing to do with those before.
  void restart();
  void archive(auto& fields) { fields(felt_, intervals_, last_stamp_s_, T_odom_last_); }
  /// Unit vector in the frame of the scan that came last; nothing before four seconds with readings.
  std::optional<Eigen::Vector3f> up() const;

 private:
  struct Felt {
    double stamp_s;
    Eigen::Vector3d acceleration;  ///< in the sensor's frame, in any unit

    void archive(auto& fields) { fields(stamp_s, acceleration); }
  };
  // Between two scans.
  struct Interval {
    double middle_s, length_s;
    Eigen::Vector3d felt, velocity_mps;  ///< means, in odometry's frame

    void archive(auto& fields) { fields(middle_s, length_s, felt, velocity_mps); }
  };
  std::optional<Eigen::Vector3d> mean_felt(double stamp_s, const Pose& T_odom_lidar) const;

  std::deque<Felt> felt_;
  std::deque<Interval> intervals_;
  std::optional<double> last_stamp_s_;
  Pose T_odom_last_ = Pose::Identity();
};

}  // namespace revisit
