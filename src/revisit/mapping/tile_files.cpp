// SPDX-License-Identifier: Apache-2.0
#include <revisit/mapping/internal/tile_files.hpp>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <fstream>
#include <string>
#include <utility>

#include <Eigen/Core>

namespace revisit::mapping_internal {

std::filesystem::path TileFiles::file(const TileIndex& tile) const {
  return folder_ / ("unfinished_" + std::to_string(tile.x) + "_" + std::to_string(tile.y));
}

Status TileFiles::replace(const TileIndex& tile, const std::vector<MapPoint>& points) const {
  std::ofstream stream(file(tile), std::ios::binary | std::ios::trunc);
  stream.write(reinterpret_cast<const char*>(points.data()),
               static_cast<std::streamsize>(points.size() * sizeof(MapPoint)));
  stream.close();
  return stream ? ok() : Status(Error{file(tile).string() + ": cannot be written: " + std::strerror(errno)});
}

Status TileFiles::append(const TileIndex& tile, std::vector<MapPoint>& points) {
  if (points.empty()) return ok();
  std::ofstream stream(file(tile), std::ios::binary | std::ios::app);
  stream.write(reinterpret_cast<const char*>(points.data()),
               static_cast<std::streamsize>(points.size() * sizeof(MapPoint)));
  stream.close();
  if (!stream) return Error{file(tile).string() + ": cannot be written: " + std::strerror(errno)};
  points = {};  // with its capacity
  return ok();
}

Status TileFiles::add(const std::vector<MapPoint>& points) {
  constexpr std::size_t kMostWaiting = 2'000'000;  // of all tiles
  for (const MapPoint& p : points) {
    const TileIndex tile{static_cast<int>(std::floor(p.x / tile_m_)), static_cast<int>(std::floor(p.y / tile_m_))};
    waiting_[tile].push_back(p);
  }
  points_waiting_ += points.size();
  return points_waiting_ < kMostWaiting ? ok() : flush();
}

Status TileFiles::flush() {
  for (auto& [tile, points] : waiting_)
    if (const Status status = append(tile, points); !status) return status;
  points_waiting_ = 0;
  return ok();
}

std::vector<TileIndex> TileFiles::tiles() const {
  std::vector<TileIndex> all;
  for (const auto& [tile, points] : waiting_) all.push_back(tile);
  return all;
}

Result<std::vector<MapPoint>> TileFiles::take(const TileIndex& tile) const {
  std::error_code failure;
  const auto bytes = std::filesystem::file_size(file(tile), failure);
  std::vector<MapPoint> points(failure ? 0 : bytes / sizeof(MapPoint));
  std::ifstream stream(file(tile), std::ios::binary);
  stream.read(reinterpret_cast<char*>(points.data()), static_cast<std::streamsize>(points.size() * sizeof(MapPoint)));
  if (!stream) return Error{file(tile).string() + ": cannot be read back"};
  if (points.empty()) return Error{file(tile).string() + ": holds no point, though some were written; who changed it?"};
  std::filesystem::remove(file(tile), failure);
  return points;
}

std::vector<MapPoint> one_point_a_voxel(const std::vector<MapPoint>& points, double voxel_m) {
  // 21 bits an axis: a million voxels either way.
  constexpr std::int64_t kOffset = 1 << 20, kMask = (1 << 21) - 1;
  const auto voxel_of = [&](const MapPoint& p) {
    std::uint64_t voxel = 0;
    for (const float value : {p.z, p.y, p.x}) {
      const auto index = static_cast<std::int64_t>(std::floor(static_cast<double>(value) / voxel_m)) + kOffset;
      voxel = voxel << 21 | static_cast<std::uint64_t>(index & kMask);
    }
    return voxel;
  };
  std::vector<std::pair<std::uint64_t, std::size_t>> by_voxel(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) by_voxel[i] = {voxel_of(points[i]), i};
  std::sort(by_voxel.begin(), by_voxel.end());
  std::vector<MapPoint> thinned;
  for (std::size_t begin = 0, end = 0; begin < by_voxel.size(); begin = end) {
    Eigen::Vector4d sum = Eigen::Vector4d::Zero();
    for (; end < by_voxel.size() && by_voxel[end].first == by_voxel[begin].first; ++end) {
      const MapPoint& p = points[by_voxel[end].second];
      sum += Eigen::Vector4d(p.x, p.y, p.z, p.intensity);
    }
    const Eigen::Vector4f mean = (sum / static_cast<double>(end - begin)).cast<float>();
    const MapPoint& first = points[by_voxel[begin].second];
    thinned.push_back({mean[0], mean[1], mean[2], mean[3], first.session, first.time});
  }
  return thinned;
}

}  // namespace revisit::mapping_internal
