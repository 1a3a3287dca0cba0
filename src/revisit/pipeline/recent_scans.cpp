// SPDX-License-Identifier: Apache-2.0
#include <revisit/pipeline/recent_scans.hpp>

#include <algorithm>

namespace revisit {
namespace {

constexpr double kVoxel_m = 0.25;

}  // namespace

void RecentScans::add(const PreparedScan& scan) {
  if (!scan.trajectory_point || (!scans_.empty() && scans_.back().at.origin != scan.trajectory_point->origin))
    scans_.clear();
  if (!scan.trajectory_point || most_ == 0) return;
  const ThinCloud cloud = thin_surfaces(scan.scan.points, scan.ground.is_ground, kVoxel_m);
  Thinned thinned;
  thinned.at = *scan.trajectory_point;
  for (std::size_t i = 0; i < cloud.points.size(); ++i)
    thinned.points.push_back({cloud.points[i].x(), cloud.points[i].y(), cloud.points[i].z(), cloud.intensity[i]});
  scans_.push_back(std::move(thinned));
  if (scans_.size() > most_) scans_.pop_front();
}

std::vector<Point> RecentScans::together(std::size_t count) const {
  std::vector<Point> points;
  const std::size_t taken = std::min(count, scans_.size());
  for (std::size_t i = scans_.size() - taken; i < scans_.size(); ++i) {
    const Eigen::Isometry3f T_last_scan = T_between(scans_.back().at, scans_[i].at).cast<float>();
    for (const Point& p : scans_[i].points) {
      const Eigen::Vector3f moved = T_last_scan * Eigen::Vector3f(p.x, p.y, p.z);
      points.push_back({moved.x(), moved.y(), moved.z(), p.intensity});
    }
  }
  return points;
}

}  // namespace revisit
