// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <compare>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include <revisit/mapping/map_point.hpp>

namespace revisit::mapping_internal {

/// A cube of 2^bits cells an edge; x, y, z count such cubes from the octree's lower corner.
struct OctreeNode {
  int bits = 0;
  std::uint32_t x = 0, y = 0, z = 0;
  auto operator<=>(const OctreeNode&) const = default;
};

/// Cells of `cell_m` from `low` on, a power of two along each edge of a node. An octree to which children ADD points:
/// every node holds at most one point a voxel of its edge / 128, the first in Morton order (Z-order) that no larger
/// node holds; the leaves, of 128 cells, hold all that is left.
struct Octree {
  static constexpr int kLeafBits = 7, kMostBits = 21;
  /// A node whose whole part of the octree has fewer points holds them all: no file is much smaller.
  static constexpr std::size_t kFew = 16384;

  Eigen::Vector3d low = Eigen::Vector3d::Zero();
  double cell_m = 0.2;
  int square_bits = 8;  ///< of the squares of the ground plane that points come in
  int root_bits = 8;    ///< of the node that holds everything, at most kMostBits

  double edge_m(int bits) const { return cell_m * static_cast<double>(std::uint32_t{1} << bits); }
  Eigen::Vector3d corner(const OctreeNode& node) const {
    return low + edge_m(node.bits) * Eigen::Vector3d(node.x, node.y, node.z);
  }
  /// 21 bits an axis, interleaved: x lowest. Points beyond the square, by rounding, or the octree count as in its
  /// outermost cells.
  std::uint64_t key(const MapPoint& point, std::uint32_t square_x, std::uint32_t square_y) const;
};

/// Gives the points of one square of the ground plane to their nodes, in Morton order: `take(node, points)` for each
/// node that lies in the square, once, with all its points, and, as many times as it has points here, for larger ones.
void split_square(const Octree& octree, std::uint32_t square_x, std::uint32_t square_y,
                  std::span<const MapPoint> square,
                  const std::function<void(const OctreeNode&, std::span<const MapPoint>)>& take);

/// Where a square comes in Morton order.
std::uint64_t morton_of_square(std::uint32_t x, std::uint32_t y);

}  // namespace revisit::mapping_internal
