// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include <revisit/core/pose.hpp>
#include <revisit/core/scan.hpp>
#include <revisit/core/twist.hpp>
#include <revisit/odometry/gravity_track.hpp>
#include <revisit/odometry/scan_matcher.hpp>
#include <revisit/preprocess/imu_track.hpp>

namespace revisit {

/// Where one scan is.
struct OdometryStep {
  double stamp_s = 0.0;                      ///< of the scan; later than that of the scan before, whatever it said
  Pose T_odom_lidar = Pose::Identity();      ///< the first scan is the origin
  Pose T_previous_lidar = Pose::Identity();  ///< motion since the scan before
  Matrix6 information = Matrix6::Zero();     ///< of that motion, as in LoopConstraint; zero where nothing measured it
  std::optional<Eigen::Vector3f> up;         ///< in the frame of the scan, at its stamp; where an IMU came with it
  /// Likewise, but from the last four seconds together with odometry's motion: slower, but far more exact.
  std::optional<Eigen::Vector3f> up_by_gravity;
  std::optional<Twist> motion;      ///< during the sweep; absent where nothing is known of it
  bool is_tracked = false;          ///< otherwise the pose is the predicted one
  bool is_connected = false;        ///< tracked, and soon after the scan before: T_previous_lidar is sure
  bool lost = false;                ///< tracking ended with this scan: the next one begins a new segment
  bool stamp_was_replaced = false;  ///< it was not after that of the scan before
  int segment = 0;                  ///< of the trajectory; between two segments tracking was lost
  /// The points as they would have been seen at the stamp; empty where these are the scan's own.
  std::vector<Point> compensated;
};

/// Follows the sensor from scan to scan: the one odometry of detection, SLAM and calibration. Compensates the motion
/// within each sweep, matches the scan with the map of what was seen lately, uses wheels and an IMU where there are
/// any, and says when it is lost. Scans come filtered by range. Belongs to one thread at a time; deterministic.
class Odometry {
 public:
  enum class Source : std::uint8_t {
    kLidar,    ///< scans are matched; a pose that comes with them is a first guess (wheels)
    kExternal  ///< the poses that come with the scans are taken as they are
  };
  explicit Odometry(Source source = Source::kLidar) : source_(source) {}

  /// `T_external_lidar`: the pose from wheels or another odometry, in any frame of its own; it may slip and drift.
  OdometryStep follow(const Scan& scan, const std::optional<Pose>& T_external_lidar = std::nullopt);

  void archive(auto& fields) {
    fields(matcher_, imu_, gravity_, has_last_, last_stamp_s_, T_odom_last_, T_external_last_, T_odom_at_external_,
           first_scan_, untracked_, segment_);
    if (fields.kReads) is_external_restored_ = true;
  }
  /// Segments count from here, before the first scan.
  void begin_at_segment(int segment) { segment_ = segment; }

 private:
  OdometryStep match(const Scan& scan, double stamp_s, const std::optional<Pose>& T_previous_lidar, bool is_guess);
  void set_external(const Pose& T_external_lidar);
  OdometryStep take(const Scan& scan, double stamp_s, const std::optional<Pose>& T_previous_lidar) const;
  std::optional<Pose> motion_by_external(const std::optional<Pose>& T_external_lidar) const;
  bool follows(double stamp_s) const;
  void begin_map_again(const Twist& motion);

  Twist with_imu(Twist predicted) const;
  std::optional<Pose> motion_by_imu(double stamp_s) const;

  Source source_;
  ScanMatcher matcher_;
  ImuTrack imu_;
  GravityTrack gravity_;
  bool has_last_ = false;
  double last_stamp_s_ = 0.0;
  Pose T_odom_last_ = Pose::Identity();
  /// Until the next scan that comes with one. Wheels go on counting while nobody listens, or begin anew: after a gap,
  /// what they say of it is a first guess, and none where nothing could have moved so far.
  bool is_external_restored_ = false;
  std::optional<Pose> T_external_last_;         ///< of the last scan that came with one
  Pose T_odom_at_external_ = Pose::Identity();  ///< ours at that scan
  std::optional<Scan> first_scan_;              ///< of a segment, as it was swept, until the motion is known
  int untracked_ = 0;                           ///< scans in a row
  int segment_ = 0;
};

}  // namespace revisit
