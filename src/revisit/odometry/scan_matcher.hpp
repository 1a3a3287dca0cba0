// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include <revisit/core/pose.hpp>
#include <revisit/core/scan.hpp>
#include <revisit/core/twist.hpp>
#include <revisit/odometry/imu_trust.hpp>
#include <revisit/odometry/last_view.hpp>
#include <revisit/odometry/local_map.hpp>
#include <revisit/odometry/velocity_filter.hpp>
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
  Pose T_previous_predicted = Pose::Identity();  ///< and as it was expected
  Matrix6 information = Matrix6::Zero();         ///< of T_previous_lidar, as in LoopConstraint
  Eigen::Matrix3d position_information = Eigen::Matrix3d::Zero();  ///< as in IcpResult
  double matched = 0.0;                                            ///< share of the points on a surface of the map
  double matched_sideways = 0.0;     ///< the same of what stands upright alone (IcpResult)
  double met = 0.0;                  ///< share with a surface of the map nearby at all
  double prediction_error_m = 0.0;   ///< of a point at the median range
  std::optional<double> measured_m;  ///< what wheels say the sensor moved
  bool is_turn_measured = false;     ///< an IMU says how T_previous_predicted is turned
  bool is_tracked = false;           ///< otherwise the pose is the predicted one
};

/// Finds scans in the map of what was seen lately: the registration inside `Odometry`. Nothing to tune: the map's
/// voxels follow from how far the first scan sees, the search radius from how well the motion is predicted. Scans come
/// in the order of their stamps. Belongs to one thread at a time; deterministic, whatever the number of threads.
class ScanMatcher {
 public:
  ScanMatcher();
  ~ScanMatcher();
  ScanMatcher(ScanMatcher&&) noexcept;
  ScanMatcher& operator=(ScanMatcher&&) noexcept;

  /// In how many rings the beams turn; none, until told. Such lines stand still in the sensor's frame, and the patches
  /// that one scan's lines make of leaves would hold back its tilt: what is uncertain then counts for less. A sparse
  /// pattern that does not repeat needs all that it meets.
  void set_rings(std::size_t rings) { rings_ = static_cast<std::uint32_t>(rings); }

  /// The predicted motion during the coming scan, where it follows closely on the last.
  std::optional<Twist> predicted_motion(double stamp_s) const;

  /// The motion to a scan that was found so far from the one before.
  Twist motion_found(const Pose& T_previous_lidar, double stamp_s) const;

  /// Thins a scan (filtered by range, its sweep compensated).
  MatcherScan thinned(std::span<const Point> points) const;
  /// Where else a scan is looked for that does not fit where it is predicted.
  enum class Search : std::uint8_t { kThere, kAround };
  /// Matches the scan with the map, which begins with the first one.
  ScanMatch match(double stamp_s, const MatcherScan& scan, const std::optional<MotionGuess>& guess = {},
                  Search search = Search::kAround) const;
  /// Matches a scan that was found at `match` once more, after its sweep was compensated with the motion found there.
  ScanMatch match_again(double stamp_s, const MatcherScan& scan, const ScanMatch& match,
                        Search search = Search::kAround) const;
  /// Goes on from there: the scan enters the map, in the background.
  void accept(double stamp_s, const MatcherScan& scan, const ScanMatch& match);

  /// Forgets what was seen: the next scan begins a map where it is predicted to be.
  void restart();
  void archive(auto& fields) {
    wait();
    bool has_map = map_ != nullptr;
    fields(has_map);
    if (!has_map) map_.reset();
    if (has_map && !map_) map_ = std::make_unique<LocalMap>(1.0, 1.0);  // of whatever size the archive says
    if (has_map) fields(*map_);
    fields(T_odom_lidar_, motion_, velocity_, forgotten_from_, last_stamp_s_, range_m_, untracked_m_, T_odom_tracked_,
           tracked_stamp_s_, squared_prediction_error_m2_, typical_match_, last_sideways_, scans_, start_was_untracked_,
           imu_trust_, rings_, last_view_);
  }

  bool has_map() const { return map_ != nullptr; }

 private:
  class Insertion;
  void wait() const;
  // Searches from `T_start`, a motion since the scan before: the predicted one, or the one that was found already. Of
  // `predicted` only the prediction is read, and what of it was measured.
  ScanMatch match_within(double radius_m, double stamp_s, const MatcherScan& scan, const ScanMatch& predicted,
                         const Pose& T_start, Search search) const;
  std::optional<PosePrior> prior_at(double stamp_s, const MatcherScan& scan, const ScanMatch& predicted) const;
  Eigen::Matrix3d position_information_at(double stamp_s, const MatcherScan& scan, const ScanMatch& predicted) const;
  double fine_m() const;
  double search_radius_m() const;
  bool is_credible(const IcpResult& icp, bool is_predicted) const;

  std::unique_ptr<LocalMap> map_;
  std::unique_ptr<Insertion> insertion_;  ///< of the last scan into the map; waited for before the map is read
  Pose T_odom_lidar_ = Pose::Identity();
  std::optional<Twist> motion_;
  VelocityFilter velocity_;
  Eigen::Vector3f forgotten_from_ = Eigen::Vector3f::Zero();  ///< where the map was last cut to its reach
  double last_stamp_s_ = 0.0, range_m_ = 0.0;
  double untracked_m_ = 0.0;                  ///< moved since the last scan that was tracked
  Pose T_odom_tracked_ = Pose::Identity();    ///< of that one
  double tracked_stamp_s_ = 0.0;              ///< of the last scan that was tracked
  double squared_prediction_error_m2_ = 0.0;  ///< running mean
  double typical_match_ = 0.0;                ///< running mean of the share that met the map
  double last_sideways_ = 0.0;                ///< matched_sideways of the last scan that was tracked
  int scans_ = 0;                             ///< in the map
  bool start_was_untracked_ = false;          ///< one of the first five
  ImuTrust imu_trust_;                        ///< that it tells turns
  std::uint32_t rings_ = 0;
  LastView last_view_;  ///< of the last scan that was tracked
};

}  // namespace revisit
