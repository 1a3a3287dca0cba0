// SPDX-License-Identifier: Apache-2.0
#include <revisit/registration/surface_cloud.hpp>

#include <algorithm>
#include <utility>

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>
#include <Eigen/Eigenvalues>

#include <revisit/registration/internal/column_grid.hpp>

namespace revisit {
namespace {

constexpr float kFewestNeighbours = 5.f;
constexpr float kLeastSpread = 0.5f;  // of a plane's narrower side (standard deviation), in voxels

// Points about one of them, summed up.
struct Neighbourhood {
  float count = 0.f;
  Eigen::Vector3f sum = Eigen::Vector3f::Zero();
  Eigen::Matrix3f squares = Eigen::Matrix3f::Zero();

  void add(const Eigen::Vector3f& offset) {
    count += 1.f;
    sum += offset;
    squares.noalias() += offset * offset.transpose();
  }
  // The direction in which the points spread least; zero where they lie along a line, whose sides are noise.
  Eigen::Vector3f normal(float least_spread_m) const {
    if (count < kFewestNeighbours) return Eigen::Vector3f::Zero();
    const Eigen::Vector3f mean = sum / count;
    Eigen::SelfAdjointEigenSolver<Eigen::Matrix3f> solver;
    solver.computeDirect(squares / count - mean * mean.transpose());
    if (solver.eigenvalues()[1] < least_spread_m * least_spread_m) return Eigen::Vector3f::Zero();
    return solver.eigenvectors().col(0);
  }
};

struct Open {
  static constexpr double kVoxel_m = 0.75;  ///< what is thinned more finely fills few voxels
  /// Of simulated rooms and warehouses (seeds 866 to 973) 95 scans in a hundred reach 46 m at most, one 51 m; a rosette
  /// in a street sees beyond in three of four scans and more.
  static constexpr float kFarthest_m = 50.f;
  /// Below this reach, the walls of a hall may be too far to be seen; below this slope, no beam looks above the
  /// horizontal. Then it says nothing that few come back from there.
  static constexpr float kLeastReach_m = 20.f, kLeastSlope = 0.02f;
  /// A sensor that looks up by 24 degrees and more tells a roof from a street. The beams of others meet crowns and
  /// houses all round in a street, too, but along it they reach farther: 55 m and more (towns 71, 72, 92, 94), in
  /// simulated halls (seeds 55 to 57) 51 m at most.
  static constexpr float kSteep = 0.45f, kFarthestBelowRoof_m = 53.f;
};

struct Seeing {
  static constexpr double kShare = 0.95;       ///< of the points above ground, the nearest: beyond, little is seen
  static constexpr double kOutermost = 0.005;  ///< of all points, the highest and the lowest
};

float nth(std::vector<float>& values, double share) {
  if (values.empty()) return 0.f;
  const auto rank = values.begin() + static_cast<std::ptrdiff_t>(static_cast<double>(values.size() - 1) * share);
  std::nth_element(values.begin(), rank, values.end());
  return *rank;
}

SensorView view_of(const ThinCloud& cloud) {
  std::vector<float> ranges, slopes;
  ranges.reserve(cloud.points.size());
  slopes.reserve(cloud.points.size());
  for (std::size_t i = 0; i < cloud.points.size(); ++i) {
    const Eigen::Vector3f& p = cloud.points[i];
    if (cloud.is_ground[i] == 0) ranges.push_back(p.norm());
    if (const float across_m = p.head<2>().norm(); across_m > 0.f) slopes.push_back(p.z() / across_m);
  }
  return {nth(ranges, Seeing::kShare), nth(slopes, Seeing::kOutermost), nth(slopes, 1.0 - Seeing::kOutermost),
          cloud.seen.sector(),         cloud.seen.is_roofed(),          cloud.seen.is_open_to_the_sides()};
}

}  // namespace

struct SurfaceCloud::Grid : registration_internal::ColumnGrid {
  using ColumnGrid::ColumnGrid;
};

ThinCloud with_before(ThinCloud cloud) {
  const auto before = std::exchange(cloud.before, nullptr);
  if (!before) return cloud;
  cloud.points.insert(cloud.points.end(), before->points.begin(), before->points.end());
  cloud.is_ground.insert(cloud.is_ground.end(), before->is_ground.begin(), before->is_ground.end());
  cloud.intensity.insert(cloud.intensity.end(), before->intensity.begin(), before->intensity.end());
  cloud.seen.add(before->seen);
  return cloud;
}

SurfaceCloud::SurfaceCloud(ThinCloud cloud) : cloud_(std::move(cloud)) {
  if (cloud_.is_ground.size() != cloud_.points.size()) cloud_.is_ground.assign(cloud_.points.size(), 0);
  if (cloud_.intensity.size() != cloud_.points.size()) cloud_.intensity.assign(cloud_.points.size(), 0.f);
  grid_ = std::make_unique<Grid>(std::span<const Eigen::Vector3f>(cloud_.points), cloud_.voxel_m);
  view_ = view_of(cloud_);
  normals_.resize(cloud_.points.size());
  constexpr std::size_t kPointsATask = 512;
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, size(), kPointsATask), [&](const auto& range) {
    for (std::size_t i = range.begin(); i < range.end(); ++i) {
      const Eigen::Vector3f& centre = cloud_.points[i];
      const float voxel_m = cloud_.voxel_m, least_spread_m = kLeastSpread * voxel_m;
      // The voxels around; where they hold a single line of the sensor, a wider neighbourhood, or a wider one yet.
      Neighbourhood near, wide, wider;
      const auto gather = [&](float radius, const auto& add) { grid_->for_each_within(centre, radius * voxel_m, add); };
      gather(1.8f, [&](std::size_t at, float) { near.add(cloud_.points[at] - centre); });
      normals_[i] = near.normal(least_spread_m);
      if (!normals_[i].isZero()) continue;
      gather(3.6f, [&](std::size_t at, float squared_m2) {
        const Eigen::Vector3f offset = cloud_.points[at] - centre;
        if (squared_m2 < 2.5f * 2.5f * voxel_m * voxel_m) wide.add(offset);
        wider.add(offset);
      });
      normals_[i] = wide.normal(least_spread_m);
      if (normals_[i].isZero()) normals_[i] = wider.normal(least_spread_m);
    }
  });
}

bool SurfaceCloud::is_in_the_open() const {
  if (view_.is_roofed && (view_.greatest_slope >= Open::kSteep || view_.farthest_m < Open::kFarthestBelowRoof_m))
    return false;
  return voxel_m() >= Open::kVoxel_m || view_.farthest_m >= Open::kFarthest_m ||
         (view_.is_open_to_the_sides && view_.sector.is_all_round() && view_.farthest_m >= Open::kLeastReach_m &&
          view_.greatest_slope >= Open::kLeastSlope);
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
  patch = {.point = cloud_.points[found->index], .normal = normals_[found->index]};
  return true;
}

}  // namespace revisit
