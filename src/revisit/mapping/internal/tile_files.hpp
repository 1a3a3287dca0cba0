// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <compare>
#include <filesystem>
#include <map>
#include <vector>

#include <revisit/core/result.hpp>
#include <revisit/mapping/map_point.hpp>

namespace revisit::mapping_internal {

struct TileIndex {
  int x = 0, y = 0;
  auto operator<=>(const TileIndex&) const = default;
};

/// Points sorted into square tiles of the ground plane on the disk, in the order in which they came: a map larger than
/// memory.
class TileFiles {
 public:
  /// Files of unfinished tiles stand in `folder`, which exists.
  TileFiles(std::filesystem::path folder, double tile_m) : folder_(std::move(folder)), tile_m_(tile_m) {}

  Status add(const std::vector<MapPoint>& points);
  /// The points of one tile, instead of what it has. Threads may work at different tiles.
  Status replace(const TileIndex& tile, const std::vector<MapPoint>& points) const;
  Status flush();
  std::vector<TileIndex> tiles() const;
  /// All points of a tile, at least one, which is flushed; its file is gone afterwards. An error names a file that is
  /// gone or was emptied meanwhile.
  Result<std::vector<MapPoint>> take(const TileIndex& tile) const;

 private:
  std::filesystem::path file(const TileIndex& tile) const;
  Status append(const TileIndex& tile, std::vector<MapPoint>& points);

  std::filesystem::path folder_;
  double tile_m_;
  std::map<TileIndex, std::vector<MapPoint>> waiting_;
  std::size_t points_waiting_ = 0;
};

/// One point a voxel, the mean of its points with the labels of the first, in the order of the voxels.
std::vector<MapPoint> one_point_a_voxel(const std::vector<MapPoint>& points, double voxel_m);

}  // namespace revisit::mapping_internal
