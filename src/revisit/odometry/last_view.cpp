// SPDX-License-Identifier: Apache-2.0
#include <revisit/odometry/last_view.hpp>

#include <algorithm>

#include <revisit/registration/seen_space.hpp>

namespace revisit {
namespace {

constexpr float kMargin_m = 0.5f, kMarginShare = 0.02f;  // of the range: what the pose may be off

SeenSpace seen_space(std::span<const Eigen::Vector3f> points) {
  std::vector<Point> copies;
  copies.reserve(points.size());
  for (const Eigen::Vector3f& p : points) copies.push_back({p.x(), p.y(), p.z(), 0.f});
  return SeenSpace(copies);
}

}  // namespace

void LastView::set(std::span<const Eigen::Vector3f> points, const Pose& T_odom_lidar) {
  points_.assign(points.begin(), points.end());
  T_odom_lidar_ = T_odom_lidar;
}

double LastView::contradicted(const Surface& map, std::span<const Eigen::Vector3f> points, const Pose& T_odom_lidar,
                              double reach_m) const {
  if (points.empty()) return 0.0;
  const SeenSpace seen = seen_space(points_);
  const Eigen::Isometry3f T_map = T_odom_lidar.cast<float>(),
                          T_last = (T_odom_lidar_.inverse() * T_odom_lidar).cast<float>();
  const auto reach2 = static_cast<float>(reach_m * reach_m);
  const auto count = std::count_if(points.begin(), points.end(), [&](const Eigen::Vector3f& p) {
    Surface::Patch patch;
    if (map.nearest_patch(T_map * p, reach2, patch) && patch.normal.squaredNorm() > 0.5f) return false;
    const Eigen::Vector3f there = T_last * p;
    return seen.look(there, kMargin_m + kMarginShare * there.norm()) == SeenSpace::Verdict::kThrough;
  });
  return static_cast<double>(count) / static_cast<double>(points.size());
}

}  // namespace revisit
