// SPDX-License-Identifier: Apache-2.0
#include <revisit/registration/surface_cloud.hpp>

#include <algorithm>
#include <cmath>

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>
#include <Eigen/Eigenvalues>

#include <revisit/registration/internal/column_grid.hpp>

namespace revisit {
namespace {

constexpr std::size_t kFewestNeighbours = 5;

// The direction in which the points spread least.
Eigen::Vector3f normal_of(const std::vector<Eigen::Vector3f>& points) {
  if (points.size() < kFewestNeighbours) return Eigen::Vector3f::Zero();
  Eigen::Vector3f mean = Eigen::Vector3f::Zero();
  for (const auto& p : points) mean += p;
  mean /= static_cast<float>(points.size());
  Eigen::Matrix3f covariance = Eigen::Matrix3f::Zero();
  for (const auto& p : points) covariance += (p - mean) * (p - mean).transpose();
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3f> solver;
  solver.computeDirect(covariance);
  return solver.eigenvectors().col(0);
}

}  // namespace

struct SurfaceCloud::Grid : registration_internal::ColumnGrid {
  using ColumnGrid::ColumnGrid;
};

SurfaceCloud::SurfaceCloud(ThinCloud cloud) : cloud_(std::move(cloud)) {
  if (cloud_.is_ground.size() != cloud_.points.size()) cloud_.is_ground.assign(cloud_.points.size(), 0);
  if (cloud_.intensity.size() != cloud_.points.size()) cloud_.intensity.assign(cloud_.points.size(), 0.f);
  grid_ = std::make_unique<Grid>(std::span<const Eigen::Vector3f>(cloud_.points), cloud_.voxel_m);
  normals_.resize(cloud_.points.size());
  constexpr std::size_t kPointsATask = 512;
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, size(), kPointsATask), [&](const auto& range) {
    std::vector<Eigen::Vector3f> around;
    for (std::size_t i = range.begin(); i < range.end(); ++i) {
      // The voxels around; where few of them are occupied, a wider neighbourhood.
      for (const float radius_m : {1.8f * cloud_.voxel_m, 3.6f * cloud_.voxel_m}) {
        around.clear();
        grid_->for_each_within(cloud_.points[i], radius_m,
                               [&](std::size_t at, float) { around.push_back(cloud_.points[at]); });
        if (around.size() >= kFewestNeighbours) break;
      }
      normals_[i] = normal_of(around);
    }
  });
}

SurfaceCloud::~SurfaceCloud() = default;
SurfaceCloud::SurfaceCloud(SurfaceCloud&&) noexcept = default;
SurfaceCloud& SurfaceCloud::operator=(SurfaceCloud&&) noexcept = default;

std::optional<SurfaceCloud::Neighbour> SurfaceCloud::nearest(const Eigen::Vector3f& query,
                                                             float squared_reach_m2) const {
  Neighbour found;
  if (!grid_->nearest(query, squared_reach_m2, found.index, found.squared_distance_m2)) return std::nullopt;
  return found;
}

bool SurfaceCloud::nearest_patch(const Eigen::Vector3f& query, float squared_reach_m2, Patch& patch) const {
  const auto found = nearest(query, squared_reach_m2);
  if (!found) return false;
  patch = {cloud_.points[found->index], normals_[found->index]};
  return true;
}

}  // namespace revisit
