// SPDX-License-Identifier: Apache-2.0
#include <revisit/pipeline/narrow_view.hpp>

#include <algorithm>
#include <array>
#include <memory>
#include <utility>
#include <vector>

namespace revisit {
namespace {

// In a second a walker turns by up to 69 degrees, and odometry in yards errs by 0.05 to 0.08 m (median). From beyond
// 3 m the view is another: what stands between hides other things.
constexpr double kLongest_s = 1.0, kFarthest_m = 3.0;

using Voxel = std::array<int, 3>;

Voxel voxel_of(const Eigen::Vector3f& p, float voxel_m) {
  const Eigen::Array3f cell = (p.array() / voxel_m).floor();
  return {static_cast<int>(cell.x()), static_cast<int>(cell.y()), static_cast<int>(cell.z())};
}

// Of `earlier`, what stands in voxels where the cloud holds nothing.
ThinCloud unseen(const RecentScans::Points& earlier, const ThinCloud& cloud) {
  std::vector<Voxel> seen(cloud.points.size());
  std::transform(cloud.points.begin(), cloud.points.end(), seen.begin(),
                 [&](const Eigen::Vector3f& p) { return voxel_of(p, cloud.voxel_m); });
  std::sort(seen.begin(), seen.end());
  ThinCloud all = thin(earlier.points, earlier.is_ground, static_cast<double>(cloud.voxel_m));
  ThinCloud left;
  left.voxel_m = all.voxel_m;
  left.seen = std::move(all.seen);
  for (std::size_t i = 0; i < all.points.size(); ++i) {
    if (std::binary_search(seen.begin(), seen.end(), voxel_of(all.points[i], cloud.voxel_m))) continue;
    left.points.push_back(all.points[i]);
    left.is_ground.push_back(all.is_ground[i]);
    left.intensity.push_back(all.intensity[i]);
  }
  return left;
}

}  // namespace

void NarrowView::widen(PreparedScan& scan) {
  if (!scan.cloud.seen.sector().is_narrow()) return;
  recent_.add(scan);
  const RecentScans::Points before = recent_.before_last(kLongest_s, kFarthest_m);
  if (before.points.empty()) return;
  scan.cloud.before = std::make_shared<ThinCloud>(unseen(before, scan.cloud));
  scan.geometry = std::make_shared<ScanGeometry>(*scan.geometry, scan.cloud.before);
}

void NarrowView::widen(PreparedScan& scan, const OdometryStep& odometry) {
  if (!odometry.is_connected) ++interruptions_;
  if (!scan.geometry) scan.geometry = std::make_shared<ScanGeometry>(scan.cloud);
  scan.trajectory_point =
      TrajectoryPoint{.segment = interruptions_, .T_segment_lidar = odometry.T_odom_lidar, .origin = odometry.segment};
  widen(scan);
  scan.trajectory_point.reset();
}

}  // namespace revisit
