// SPDX-License-Identifier: Apache-2.0
#include <revisit/evaluation/reference.hpp>

#include <algorithm>
#include <cmath>

namespace revisit {

Reference::Reference(Trajectory trajectory, const EvaluationRules& rules)
    : trajectory_(std::move(trajectory)), rules_(rules) {
  const double reverse_cosine = std::cos(to_radians(rules_.reverse_heading_deg));
  for (const auto& [query, at] : trajectory_.entries) {
    std::optional<Revisit> nearest;
    for (const auto& [frame, other] : trajectory_.entries) {
      if (query.value - frame.value < rules_.exclude_frames) break;  // frames increase
      if (!rules_.allows({query, at.stamp_s}, {frame, other.stamp_s})) continue;
      const double distance = (at.T_world_lidar.translation() - other.T_world_lidar.translation()).norm();
      if (distance > rules_.same_place_m || (nearest && distance >= nearest->distance_m)) continue;
      const Eigen::Vector3d heading = at.T_world_lidar.linear().col(0), then = other.T_world_lidar.linear().col(0);
      nearest = Revisit{frame, distance, heading.dot(then) < reverse_cosine};
    }
    if (nearest) revisits_[query] = *nearest;
  }
}

std::size_t Reference::reverse_revisits() const {
  return static_cast<std::size_t>(
      std::count_if(revisits_.begin(), revisits_.end(), [](const auto& each) { return each.second.reverse; }));
}

std::optional<double> Reference::distance_m(FrameId a, FrameId b) const {
  const auto T = T_match_query(a, b);
  if (!T) return std::nullopt;
  return T->translation().norm();
}

std::optional<Pose> Reference::T_match_query(FrameId match, FrameId query) const {
  const auto T_world_match = trajectory_.at(match), T_world_query = trajectory_.at(query);
  if (!T_world_match || !T_world_query) return std::nullopt;
  return T_world_match->inverse() * *T_world_query;
}

}  // namespace revisit
