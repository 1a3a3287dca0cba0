// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include <revisit/core/pose.hpp>
#include <revisit/core/result.hpp>
#include <revisit/core/scan.hpp>
#include <revisit/mapping/cloud_file.hpp>

namespace revisit {

struct MapOptions {
  double voxel_m = 0.2;     ///< edge of the voxels: one point each
  bool thin_moving = true;  ///< leave out what stood there for a moment only
  /// Of the whole map, one file each: map.ply, map.pcd, map.las.
  std::vector<CloudFormat> formats = {CloudFormat::kPly, CloudFormat::kPcd, CloudFormat::kLas};
  Eigen::Vector3d las_offset_m = Eigen::Vector3d::Zero();  ///< as for CloudFile
  int las_epsg = 0;                                        ///< likewise
  /// Where the world near a point of it lies in the coordinates of map.las; absent: those of the world.
  std::function<Pose(const Eigen::Vector3d& near_m)> T_las_world = {};
};

struct MapReport {
  std::size_t points = 0, moving = 0;  ///< of the map; left out, before thinning
};

/// The key frames of a map in the order of the recording.
struct MapInput {
  std::vector<Pose> T_world_keyframes;
  std::function<Result<std::vector<Point>>(std::size_t)> points;  ///< of key frame i in its own frame, or none
  std::vector<int> sessions = {};                                 ///< of each key frame; empty: all of one
};

/// The map as points in the world's frame: one a voxel, without what moved. In memory at once. `progress(done)` counts
/// key frames and stops the work by returning false: then there are none.
Result<std::vector<Point>> collect_map(const MapInput& input, const MapOptions& options,
                                       const std::function<bool(std::size_t)>& progress = {});

/// Puts key frames together into `folder`: a file a format, and tiles/ as TilesetWriter has it.
/// In memory are some key frames and a few squares of 50 m at a time. `progress(done)` counts key frames and stops the
/// work by returning false: then nothing is written.
Result<MapReport> build_map(const MapInput& input, const MapOptions& options, const std::filesystem::path& folder,
                            const std::function<bool(std::size_t)>& progress = {});

}  // namespace revisit
