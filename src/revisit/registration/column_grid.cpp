// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include <revisit/core/fast_math.hpp>
#include <revisit/registration/internal/column_grid.hpp>

namespace revisit::registration_internal {

ColumnGrid::ColumnGrid(std::span<const Eigen::Vector3f> points, float cell_m)
    : cells_per_m_(1.f / cell_m), cell_m_(cell_m) {
  if (points.empty()) return;
  int last[2] = {-kFarthest, -kFarthest};
  first_[0] = first_[1] = kFarthest;
  for (const auto& p : points) {
    for (int axis = 0; axis < 2; ++axis) {
      const int cell = cell_of(p[axis]);
      first_[axis] = std::min(first_[axis], cell);
      last[axis] = std::max(last[axis], cell);
    }
  }
  for (int axis = 0; axis < 2; ++axis) count_[axis] = last[axis] - first_[axis] + 1;
  // A counting sort by columns.
  const auto column_of = [&](const Eigen::Vector3f& p) {
    return static_cast<std::size_t>(cell_of(p.x()) - first_[0]) * static_cast<std::size_t>(count_[1]) +
           static_cast<std::size_t>(cell_of(p.y()) - first_[1]);
  };
  begin_.assign(static_cast<std::size_t>(count_[0]) * static_cast<std::size_t>(count_[1]) + 1, 0);
  for (const auto& p : points) ++begin_[column_of(p)];
  std::uint32_t end = 0;
  for (std::uint32_t& each : begin_) each = end += each;
  entries_.resize(points.size());
  for (std::size_t i = points.size(); i-- > 0;)
    entries_[--begin_[column_of(points[i])]] = {points[i], static_cast<std::uint32_t>(i)};
}

int ColumnGrid::cell_of(float metres) const {
  constexpr auto kMost = static_cast<float>(kFarthest);
  return floor_to_int(std::clamp(metres * cells_per_m_, -kMost, kMost - 1.f));
}

ColumnGrid::Square ColumnGrid::square(const Eigen::Vector3f& centre, float radius_m) const {
  const auto clamped = [&](float metres, int axis, int more) {
    return std::clamp(cell_of(metres) - first_[axis] + more, 0, count_[axis]);
  };
  return {clamped(centre.x() - radius_m, 0, 0), clamped(centre.x() + radius_m, 0, 1),
          clamped(centre.y() - radius_m, 1, 0), clamped(centre.y() + radius_m, 1, 1)};
}

bool ColumnGrid::nearest(const Eigen::Vector3f& p, float squared_reach_m2, std::size_t& index,
                         float& squared_distance_m2) const {
  if (entries_.empty() || !p.allFinite()) return false;
  const float reach_m = std::sqrt(squared_reach_m2);
  const Square everything{0, count_[0], 0, count_[1]};
  squared_distance_m2 = squared_reach_m2;
  bool found = false;
  // Wider and wider squares, until nothing outside can be nearer than what was found.
  for (float radius_m = std::min(cell_m_, reach_m);; radius_m = std::min(radius_m + cell_m_, reach_m)) {
    const Square around = square(p, radius_m);
    for_each_beside(around, [&](const Entry& entry) {
      const float d2 = (entry.point - p).squaredNorm();
      if (d2 >= squared_distance_m2) return;
      squared_distance_m2 = d2;
      index = entry.index;
      found = true;
    });
    if ((found && squared_distance_m2 <= radius_m * radius_m) || radius_m >= reach_m || around == everything)
      return found;
  }
}

}  // namespace revisit::registration_internal
