// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <span>
#include <vector>

#include <Eigen/Core>

#include <revisit/core/scan.hpp>

namespace revisit::descriptors_internal {

/// Heights above the ground at which a view from above is cut.
inline constexpr std::array kContourLevels_m{1.7f, 2.2f, 2.7f, 3.2f};

/// What stands higher than its level and hangs together: cells of 1 m, seen from above.
struct Contour {
  int level = 0;
  Eigen::Vector2f centre = Eigen::Vector2f::Zero();      ///< metres
  Eigen::Matrix2f covariance = Eigen::Matrix2f::Zero();  ///< of its cells, metres^2
  float cells = 0.f;
  float height_m = 0.f;  ///< mean, above the ground
};

/// A view from above: the highest point of each cell, and the contours of each level, the largest first.
struct ContourMap {
  struct Top {
    Eigen::Vector2f position;
    float height_m;
  };
  std::vector<Top> tops;  ///< of the cells that reach the lowest level
  std::array<std::vector<Contour>, kContourLevels_m.size()> contours;
};
ContourMap find_contours(std::span<const Point> points, float ground_z_m);

}  // namespace revisit::descriptors_internal
