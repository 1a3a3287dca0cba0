// SPDX-License-Identifier: Apache-2.0
#include <revisit/pipeline/recent_scans.hpp>

#include <algorithm>
#include <cmath>

namespace revisit {
namespace {

constexpr double kVoxel_m = 0.25;
constexpr float kLargest_m = 1e6f;  // beyond what any sensor sees

}  // namespace

void RecentScans::add(const PreparedScan& scan) {
  if (!scan.trajectory_point || (!scans_.empty() && scans_.back().at.origin != scan.trajectory_point->origin))
    scans_.clear();
  if (!scan.trajectory_point || most_ == 0) return;
  const ThinCloud cloud = thin_surfaces(scan.scan.points, scan.ground.is_ground, kVoxel_m);
  Thinned thinned;
  thinned.at = *scan.trajectory_point;
  thinned.stamp_s = scan.scan.stamp_s;
  for (std::size_t i = 0; i < cloud.points.size(); ++i)
    thinned.all.points.push_back({cloud.points[i].x(), cloud.points[i].y(), cloud.points[i].z(), cloud.intensity[i]});
  thinned.all.is_ground = cloud.is_ground;
  scans_.push_back(std::move(thinned));
  if (scans_.size() > most_) scans_.pop_front();
}

// The state of a run may have been altered: what is read back must not break what works with it.
bool RecentScans::Thinned::is_sound() const {
  const auto is_near = [](const Point& p) {
    return std::abs(p.x) < kLargest_m && std::abs(p.y) < kLargest_m && std::abs(p.z) < kLargest_m &&
           std::isfinite(p.intensity);
  };
  return all.points.size() == all.is_ground.size() && std::all_of(all.points.begin(), all.points.end(), is_near) &&
         at.T_segment_lidar.linear().isUnitary(1e-6) && at.T_segment_lidar.translation().allFinite();
}

void RecentScans::append(const Thinned& scan, Points& to) const {
  const Eigen::Isometry3f T_last_scan = T_between(scans_.back().at, scan.at).cast<float>();
  for (const Point& p : scan.all.points) {
    const Eigen::Vector3f moved = T_last_scan * Eigen::Vector3f(p.x, p.y, p.z);
    to.points.push_back({moved.x(), moved.y(), moved.z(), p.intensity});
  }
  to.is_ground.insert(to.is_ground.end(), scan.all.is_ground.begin(), scan.all.is_ground.end());
}

std::vector<Point> RecentScans::together(std::size_t count) const {
  Points all;
  const std::size_t taken = std::min(count, scans_.size());
  for (std::size_t i = scans_.size() - taken; i < scans_.size(); ++i) append(scans_[i], all);
  return std::move(all.points);
}

RecentScans::Points RecentScans::before_last(double time_s, double distance_m) const {
  Points all;
  for (std::size_t i = 0; i + 1 < scans_.size(); ++i) {
    const Thinned &scan = scans_[i], &last = scans_.back();
    if (last.stamp_s - scan.stamp_s <= time_s && scan.at.segment == last.at.segment &&
        T_between(last.at, scan.at).translation().norm() <= distance_m)
      append(scan, all);
  }
  return all;
}

}  // namespace revisit
