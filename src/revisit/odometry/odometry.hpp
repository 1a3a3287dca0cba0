// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <vector>

#include <revisit/core/pose.hpp>
#include <revisit/core/scan.hpp>
#include <revisit/core/twist.hpp>
#include <revisit/odometry/local_map.hpp>

namespace revisit {

/// A scan thinned for tracking, in its own frame.
struct OdometryScan {
  std::vector<Eigen::Vector3f> points;      ///< one a voxel of the map: what is found in it
  std::vector<Eigen::Vector3f> map_points;  ///< some more: what enters it
  double voxel_m = 1.0, range_m = 10.0;     ///< edge of a voxel; the median range
};

/// Where one scan was found to be.
struct OdometryStep {
  Pose T_odom_lidar = Pose::Identity();    ///< at the scan's stamp; the first scan is the origin
  Pose T_before_now = Pose::Identity();    ///< since the scan before
  Pose T_before_found = Pose::Identity();  ///< since the scan before, as registration has it, believed or not
  Matrix6 information = Matrix6::Zero();   ///< of T_before_now, as in LoopConstraint
  double matched = 0.0;                    ///< share of the scan's points that lie on a surface of the map
  double met = 0.0;                        ///< share with a surface of the map nearby at all
  double surprise_m = 0.0;                 ///< how far what was found is from what was expected, at the median range
  bool is_tracked = false;                 ///< otherwise the pose is the one that was expected
};

/// Tracks a LiDAR against the map of what it saw lately. Nothing to tune: the map's voxels follow from how far the
/// first scan sees, the search radius from how well the motion is foreseen. Scans come in the order of their stamps.
/// Belongs to one thread at a time; deterministic, whatever the number of threads underneath.
class Odometry {
 public:
  /// The motion during the coming scan, if it follows closely on the last: to undo its distortion with.
  std::optional<Twist> expected(double stamp_s) const;

  /// Thins a scan (filtered by range, undistorted).
  OdometryScan thinned(std::span<const Point> points) const;
  /// Finds the scan in the map. `T_before_now`, if there is one, is what wheels or another odometry measured since the
  /// scan before: the guess, and the answer where the map gives none.
  OdometryStep find(double stamp_s, const OdometryScan& scan, const std::optional<Pose>& T_before_now = {}) const;
  /// Goes on from there: the scan enters the map.
  void accept(double stamp_s, const OdometryScan& scan, const OdometryStep& step);
  /// All three.
  OdometryStep track(double stamp_s, std::span<const Point> points, const std::optional<Pose>& T_before_now = {});

  /// Forgets what was seen: the next scan begins a map of its own where it is expected to be. For a track that is lost.
  void restart();
  /// Goes on from here, with the motion since the scan before, if any. For a map that was put together from elsewhere.
  void stand_at(double stamp_s, const Pose& T_odom_lidar, const std::optional<Twist>& motion);

  const LocalMap* map() const { return map_ ? &*map_ : nullptr; }

 private:
  double search_radius_m() const;
  bool is_believed(double matched, double met) const;

  std::optional<LocalMap> map_;
  Pose T_odom_lidar_ = Pose::Identity();
  std::optional<Twist> motion_;
  Eigen::Vector3f forgotten_from_ = Eigen::Vector3f::Zero();  ///< where the map was last cut to its reach
  double last_stamp_s_ = 0.0, range_m_ = 0.0;
  double squared_surprise_m2_ = 0.0;  ///< running mean of how far expectation was off
  double usual_match_ = 0.0;          ///< running mean of the share that met the map
  int scans_ = 0;                     ///< in the map
};

}  // namespace revisit
