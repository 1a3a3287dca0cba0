// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

#include <revisit/core/pose.hpp>
#include <revisit/registration/surface.hpp>

namespace revisit {

/// What the last tracked scan saw. Tells apart what of the next one should meet the map, and what is new: a narrow
/// sensor that turns, or one that comes round a corner, sees mostly what nobody saw before.
class LastView {
 public:
  /// `points` in the LiDAR's frame, finite, metres.
  void set(std::span<const Eigen::Vector3f> points, const Pose& T_odom_lidar);

  /// Share of a scan's points, at that pose, that meet nothing in the map although the last scan saw through them.
  double contradicted(const Surface& map, std::span<const Eigen::Vector3f> points, const Pose& T_odom_lidar,
                      double reach_m) const;

  void archive(auto& fields) { fields(points_, T_odom_lidar_); }

 private:
  std::vector<Eigen::Vector3f> points_;
  Pose T_odom_lidar_ = Pose::Identity();
};

}  // namespace revisit
