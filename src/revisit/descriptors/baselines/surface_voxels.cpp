// SPDX-License-Identifier: Apache-2.0
#include <revisit/descriptors/internal/surface_voxels.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

#include <Eigen/Eigenvalues>

namespace revisit::descriptors_internal {
namespace {

constexpr std::size_t kFewestInAVoxel = 10;
constexpr float kFarthest_m = 100.f;  // cells are counted from there

Eigen::Vector3f flat_normal(const std::vector<Eigen::Vector3f>& points, const Eigen::Vector3f& centre, float flat_m2) {
  if (points.size() < kFewestInAVoxel) return Eigen::Vector3f::Zero();
  Eigen::Matrix3f covariance = Eigen::Matrix3f::Zero();
  for (const Eigen::Vector3f& point : points) covariance += (point - centre) * (point - centre).transpose();
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3f> solver;
  solver.computeDirect(covariance / static_cast<float>(points.size()));
  if (solver.eigenvalues()[0] >= flat_m2) return Eigen::Vector3f::Zero();
  const Eigen::Vector3f normal = solver.eigenvectors().col(0);
  return normal.dot(centre) > 0.f ? Eigen::Vector3f(-normal) : normal;  // towards the sensor
}

}  // namespace

std::vector<SurfaceVoxel> surface_voxels(std::span<const Point> points, float size_m, float flat_m2) {
  std::vector<std::pair<std::uint64_t, std::uint32_t>> cells;
  cells.reserve(points.size());
  const auto cell = [&](float metres) { return static_cast<std::uint64_t>((metres + kFarthest_m) / size_m); };
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Point& p = points[i];
    if (!(std::abs(p.x) < kFarthest_m && std::abs(p.y) < kFarthest_m && std::abs(p.z) < kFarthest_m)) continue;
    cells.emplace_back(cell(p.x) << 40 | cell(p.y) << 20 | cell(p.z), static_cast<std::uint32_t>(i));
  }
  std::sort(cells.begin(), cells.end());
  std::vector<SurfaceVoxel> voxels;
  for (std::size_t begin = 0, end = 0; begin < cells.size(); begin = end) {
    const std::uint64_t key = cells[begin].first;
    const auto axis = [&](int shift) { return static_cast<int>(key >> shift & 0xfffffu); };
    SurfaceVoxel& voxel = voxels.emplace_back();
    voxel.cell = {axis(40), axis(20), axis(0)};
    for (end = begin; end < cells.size() && cells[end].first == key; ++end) {
      const Point& p = points[cells[end].second];
      voxel.points.emplace_back(p.x, p.y, p.z);
      voxel.centre += voxel.points.back();
    }
    voxel.centre /= static_cast<float>(voxel.points.size());
    voxel.normal = flat_normal(voxel.points, voxel.centre, flat_m2);
  }
  return voxels;
}

}  // namespace revisit::descriptors_internal
