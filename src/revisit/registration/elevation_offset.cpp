// SPDX-License-Identifier: Apache-2.0
#include <revisit/registration/elevation_offset.hpp>

#include <algorithm>
#include <cmath>

#include <oneapi/tbb/parallel_for.h>
#include <Eigen/Cholesky>

#include <revisit/registration/icp.hpp>
#include <revisit/registration/surface_cloud.hpp>

namespace revisit {
namespace {

struct Learning {
  static constexpr std::size_t kMostViews = 60, kFewestPairs = 10, kFewestMeetings = 200;
  static constexpr double kVoxel_m = 1.0, kApart_m = 2.0, kNearest_m = 4.0, kFarthest_m = 12.0;
  static constexpr double kKernel_m = 0.3, kReach_m = 1.0;
  static constexpr int kSteps = 4;
};

struct PairOfViews {
  std::size_t target, source;
  Pose T_target_source;
  double g = 0.0, s = 0.0;  // of the offset, the pose eliminated: the step is -g / s
};

// How a point moves where elevations grow, metres a radian.
Eigen::Vector3d upwards(const Eigen::Vector3d& p) {
  const double across_m = std::max(p.head<2>().norm(), 1e-6);
  return {-p.z() * p.x() / across_m, -p.z() * p.y() / across_m, across_m};
}

SurfaceCloud surface_of(std::span<const Eigen::Vector3f> points, double offset_rad) {
  ThinCloud cloud;
  cloud.voxel_m = static_cast<float>(Learning::kVoxel_m);
  for (const Eigen::Vector3f& p : points) {
    const Eigen::Vector3d at = p.cast<double>();
    cloud.points.push_back((std::cos(offset_rad) * at + std::sin(offset_rad) * upwards(at)).cast<float>());
  }
  cloud.is_ground.assign(points.size(), 0);
  cloud.intensity.assign(points.size(), 0.f);
  return SurfaceCloud(std::move(cloud));
}

// Registers the pair, and leaves in it what it says of the offset.
void compare(const SurfaceCloud& target, const SurfaceCloud& source, PairOfViews& pair) {
  const IcpResult icp =
      align_icp(target, source.points(), pair.T_target_source, {.coarse_m = 1.0, .fine_m = Learning::kKernel_m});
  pair.g = pair.s = 0.0;
  if (!icp.converged) return;
  pair.T_target_source = icp.T_target_source;
  Eigen::Matrix<double, 7, 7> H = Eigen::Matrix<double, 7, 7>::Zero();
  Eigen::Matrix<double, 7, 1> g = Eigen::Matrix<double, 7, 1>::Zero();
  std::size_t meetings = 0;
  for (const Eigen::Vector3f& point : source.points()) {
    const Eigen::Vector3d p = point.cast<double>(), there = pair.T_target_source * p;
    Surface::Patch patch;
    if (!target.nearest_patch(there.cast<float>(), static_cast<float>(Learning::kReach_m * Learning::kReach_m), patch))
      continue;
    const Eigen::Vector3d q = patch.point.cast<double>(), n = patch.normal.cast<double>();
    if (n.squaredNorm() < 0.5) continue;
    const double residual = n.dot(there - q), width2 = Learning::kKernel_m * Learning::kKernel_m / 4.0;
    const double root = width2 / (width2 + residual * residual);
    Eigen::Matrix<double, 7, 1> J;
    J << n, (there - pair.T_target_source.translation()).cross(n),
        n.dot(pair.T_target_source.linear() * upwards(p) - upwards(q));
    H.noalias() += root * root * J * J.transpose();
    g += root * root * residual * J;
    ++meetings;
  }
  if (meetings < Learning::kFewestMeetings) return;
  const Vector6 pose_to_offset = H.topLeftCorner<6, 6>().ldlt().solve(Vector6(H.topRightCorner<6, 1>()));
  pair.s = H(6, 6) - H.topRightCorner<6, 1>().dot(pose_to_offset);
  pair.g = g(6) - g.head<6>().dot(pose_to_offset);
}

}  // namespace

void ElevationLearner::add(std::span<const Point> points, const Pose& T_world_lidar) {
  if (views_.size() == Learning::kMostViews) return;
  if (!views_.empty() &&
      (views_.back().T_world_lidar.inverse() * T_world_lidar).translation().norm() < Learning::kApart_m)
    return;
  views_.push_back({thin_surfaces(points, {}, Learning::kVoxel_m).points, T_world_lidar});
}

std::optional<ElevationOffset> ElevationLearner::solve() const {
  std::vector<PairOfViews> pairs;
  for (std::size_t source = 0; source < views_.size(); ++source)
    for (std::size_t target = 0; target < source; ++target) {
      const Pose T = views_[target].T_world_lidar.inverse() * views_[source].T_world_lidar;
      const double apart_m = T.translation().norm();
      if (apart_m >= Learning::kNearest_m && apart_m <= Learning::kFarthest_m) pairs.push_back({target, source, T});
    }
  double offset_rad = 0.0;
  for (int step = 0; step < Learning::kSteps; ++step) {
    std::vector<std::optional<SurfaceCloud>> surfaces(views_.size());
    tbb::parallel_for(std::size_t{0}, views_.size(),
                      [&](std::size_t i) { surfaces[i] = surface_of(views_[i].points, offset_rad); });
    tbb::parallel_for(std::size_t{0}, pairs.size(), [&](std::size_t i) {
      compare(*surfaces[pairs[i].target], *surfaces[pairs[i].source], pairs[i]);
    });
    double g = 0.0, s = 0.0;
    for (const PairOfViews& pair : pairs) g += pair.g, s += pair.s;
    if (s > 0.0) offset_rad -= g / s;
  }
  ElevationOffset found;
  double s = 0.0, squares = 0.0;
  for (const PairOfViews& pair : pairs) {
    if (pair.s <= 0.0) continue;
    ++found.pairs;
    s += pair.s;
    squares += pair.g * pair.g;
  }
  if (found.pairs < Learning::kFewestPairs) return std::nullopt;
  found.offset_deg = to_degrees(offset_rad);
  found.deviation_deg = to_degrees(std::sqrt(squares) / s);
  return found;
}

}  // namespace revisit
