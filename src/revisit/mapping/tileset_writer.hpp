// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <span>
#include <vector>

#include <Eigen/Core>

#include <revisit/core/result.hpp>
#include <revisit/mapping/map_point.hpp>

namespace revisit {

/// Where points will lie, and how fine they are.
struct TilesetBounds {
  Eigen::Vector3d low = Eigen::Vector3d::Zero(), high = Eigen::Vector3d::Zero();  ///< metres
  double voxel_m = 0.2;  ///< at most one point, or a few, in each
};

/// Writes a map that a viewer streams: OGC 3D Tiles 1.1, an octree of glTF points with levels of detail, where a child
/// adds points to its parent's; tileset.json and a .glb a node (docs/formats.md). Points come square by square of the
/// ground plane; in memory are a few squares and one node a level. The bytes do not depend on the number of threads.
/// One thread at a time.
class TilesetWriter {
 public:
  struct Square {
    std::uint32_t x = 0, y = 0;  ///< covers [x, x + 1) * square_m() from `low` on
    std::vector<MapPoint> points;
  };

  /// Of `folder`, which exists.
  TilesetWriter(std::filesystem::path folder, const TilesetBounds& bounds);
  ~TilesetWriter();

  /// Edge of the squares: a power of two of voxels, at least 50 m.
  static double square_m(double voxel_m);
  /// The order in which squares are to come: Morton's.
  static std::uint64_t order(std::uint32_t x, std::uint32_t y);

  /// Some squares, worked on side by side: as many at a time as fit in memory. Each comes once.
  Status add(std::span<const Square> squares);
  /// Everything is with the system when this returns without an error; the error names the file.
  Status finish();
  std::size_t points() const;

 private:
  class Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace revisit
