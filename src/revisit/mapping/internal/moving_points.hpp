// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <revisit/core/pose.hpp>
#include <revisit/core/scan.hpp>

namespace revisit::mapping_internal {

/// The nearest range that a key frame saw in each direction, in cells of a degree.
class VisibilityImage {
 public:
  explicit VisibilityImage(std::span<const Point> points);

  enum class Verdict : std::uint8_t { kUnknown, kThrough, kSurface };
  /// `p` in the key frame's frame. It was seen through where all around its direction lies beyond it.
  Verdict look(const Eigen::Vector3f& p) const;

 private:
  std::vector<float>
      ranges_m_;  ///< [azimuth][elevation], the least of a cell and those around it; 0: nothing came back
};

/// A key frame that looks at the points of another one.
struct Observer {
  Pose T_world_lidar = Pose::Identity();
  const VisibilityImage* image = nullptr;
};

/// Which of the points, in the frame of `T_world_lidar`, stood there for a moment only: more observers saw through them
/// than saw something there. 1: moving.
std::vector<std::uint8_t> find_moving(std::span<const Point> points, const Pose& T_world_lidar,
                                      std::span<const Observer> observers);

}  // namespace revisit::mapping_internal
