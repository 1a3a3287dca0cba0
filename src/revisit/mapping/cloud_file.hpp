// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <fstream>
#include <functional>
#include <span>

#include <Eigen/Core>

#include <revisit/core/result.hpp>
#include <revisit/core/scan.hpp>

namespace revisit {

enum class CloudFormat { kPly, kPcd, kLas };

/// Writes points with intensity, binary, part by part: a cloud may be larger than memory. LAS (1.4, point format 6) has
/// positions to a millimetre and intensities from 0 to 65535.
class CloudFile {
 public:
  /// The header tells how many points follow: add() exactly `count`. `las_offset_m` is added to the points, in the
  /// header of a LAS file alone. `las_epsg`: the UTM zone that its coordinates are in then (326xx or 327xx), 0 for
  /// none.
  CloudFile(const std::filesystem::path& file, CloudFormat format, std::size_t count,
            const Eigen::Vector3d& las_offset_m = Eigen::Vector3d::Zero(), int las_epsg = 0);
  void add(std::span<const Point> points);
  /// Everything is with the system when this returns without an error; the error names the file.
  Status finish();

 private:
  void write_head();
  void write_las_points(std::span<const Point> points);

  std::filesystem::path file_;
  CloudFormat format_;
  std::ofstream stream_;
  std::size_t count_, left_;
  Eigen::Vector3d las_offset_m_;
  int las_epsg_;
  Eigen::Vector3d lowest_ = Eigen::Vector3d::Zero(), highest_ = Eigen::Vector3d::Zero();
};

/// Reads a PLY that CloudFile wrote, part by part.
Status read_back(const std::filesystem::path& ply, const std::function<void(std::span<const Point>)>& take);

}  // namespace revisit
