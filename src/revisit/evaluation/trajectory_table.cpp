// SPDX-License-Identifier: Apache-2.0
#include <revisit/evaluation/trajectory_table.hpp>

#include <algorithm>
#include <cmath>
#include <vector>

namespace revisit {
namespace {

struct Pair {
  Pose estimate, reference;
  double way_m;  // of the reference, until here
};

std::vector<Pair> common_frames(const Trajectory& estimate, const Trajectory& reference) {
  std::vector<Pair> pairs;
  for (const auto& [frame, entry] : reference.entries) {
    const auto found = estimate.at(frame);
    if (!found) continue;
    const double step_m =
        pairs.empty() ? 0.0 : (entry.T_world_lidar.translation() - pairs.back().reference.translation()).norm();
    pairs.push_back({*found, entry.T_world_lidar, (pairs.empty() ? 0.0 : pairs.back().way_m) + step_m});
  }
  return pairs;
}

// The rigid transform that brings the positions of the estimate nearest to those of the reference (Umeyama, 1991).
Pose align(const std::vector<Pair>& pairs) {
  Eigen::Matrix3Xd from(3, static_cast<Eigen::Index>(pairs.size())), to = from;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    from.col(static_cast<Eigen::Index>(i)) = pairs[i].estimate.translation();
    to.col(static_cast<Eigen::Index>(i)) = pairs[i].reference.translation();
  }
  return Pose(Eigen::umeyama(from, to, false));
}

}  // namespace

TrajectoryTable evaluate_trajectory(const Trajectory& estimate, const Trajectory& reference) {
  TrajectoryTable table;
  const std::vector<Pair> pairs = common_frames(estimate, reference);
  table.frames = pairs.size();
  if (pairs.size() < 2) return table;
  table.length_m = pairs.back().way_m;
  table.T_reference_estimate = align(pairs);
  double squared = 0.0;
  for (const Pair& pair : pairs) {
    const double error_m =
        (table.T_reference_estimate * pair.estimate.translation() - pair.reference.translation()).norm();
    squared += error_m * error_m;
    table.worst_m = std::max(table.worst_m, error_m);
  }
  table.ate_m = std::sqrt(squared / static_cast<double>(pairs.size()));

  // As KITTI's development kit: from every tenth frame on, to the first frame that lies the length further.
  double percent = 0.0, deg_per_m = 0.0;
  std::size_t count = 0;
  constexpr std::size_t kStride = 10;
  for (const double length_m : {100.0, 200.0, 300.0, 400.0, 500.0, 600.0, 700.0, 800.0})
    for (std::size_t i = 0; i < pairs.size(); i += kStride) {
      const auto end = std::find_if(pairs.begin() + static_cast<std::ptrdiff_t>(i), pairs.end(),
                                    [&](const Pair& pair) { return pair.way_m > pairs[i].way_m + length_m; });
      if (end == pairs.end()) break;
      const Pose error =
          (pairs[i].reference.inverse() * end->reference).inverse() * (pairs[i].estimate.inverse() * end->estimate);
      percent += 100.0 * error.translation().norm() / length_m;
      deg_per_m += to_degrees(rotation_angle(error)) / length_m;
      ++count;
    }
  if (count > 0) {
    table.relative_percent = percent / static_cast<double>(count);
    table.relative_deg_per_m = deg_per_m / static_cast<double>(count);
  }
  return table;
}

}  // namespace revisit
