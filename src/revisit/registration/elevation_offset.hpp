// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include <revisit/core/pose.hpp>
#include <revisit/core/scan.hpp>

namespace revisit {

struct ElevationOffset {
  double offset_deg = 0.0;     ///< to be added to the elevation of every point (PreprocessOptions)
  double deviation_deg = 0.0;  ///< standard deviation, by how pairs of scans differ
  std::size_t pairs = 0;       ///< of scans that were compared
};

/// Learns from a drive by how much the elevations of a spinning sensor are off, all of them alike: the ground ahead
/// would lie on a cone, which does not fit the same ground once it is driven over. Gauss-Newton over pairs of scans 4
/// to 12 m apart, point-to-plane, with one pose a pair and one offset for all. Belongs to one thread at a time.
class ElevationLearner {
 public:
  /// `points`: filtered by range, sweep compensated, LiDAR frame; the pose may be off by some decimetres. Scans too
  /// near to the last one, and all after the first 60, are left out.
  void add(std::span<const Point> points, const Pose& T_world_lidar);

  /// Nothing where fewer than ten pairs meet.
  std::optional<ElevationOffset> solve() const;

 private:
  struct View {
    std::vector<Eigen::Vector3f> points;
    Pose T_world_lidar;
  };
  std::vector<View> views_;
};

}  // namespace revisit
