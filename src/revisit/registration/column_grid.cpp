// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include <revisit/registration/internal/column_grid.hpp>

namespace revisit::registration_internal {
namespace {

int clamped_floor(float cells) {
  constexpr auto kMost = static_cast<float>(ColumnGrid::kFarthest);
  return static_cast<int>(std::floor(std::clamp(cells, -kMost, kMost - 1.f)));
}

int level_of(float metres_above, float cell_m) {
  return static_cast<int>(std::clamp(metres_above / cell_m, 0.f, 63.f));
}

}  // namespace

ColumnGrid::ColumnGrid(std::span<const Eigen::Vector3f> points, float cell_m) : cell_m_(cell_m) {
  if (points.empty()) return;
  int last[2] = {-kFarthest, -kFarthest};
  first_[0] = first_[1] = kFarthest;
  lowest_m_ = points[0].z();
  for (const auto& p : points) {
    lowest_m_ = std::min(lowest_m_, p.z());
    for (int axis = 0; axis < 2; ++axis) {
      const int cell = clamped_floor(p[axis] / cell_m_);
      first_[axis] = std::min(first_[axis], cell);
      last[axis] = std::max(last[axis], cell);
    }
  }
  for (int axis = 0; axis < 2; ++axis) count_[axis] = last[axis] - first_[axis] + 1;
  columns_.resize(static_cast<std::size_t>(count_[0]) * static_cast<std::size_t>(count_[1]));
  const auto column_of = [&](const Eigen::Vector3f& p) -> Column& {
    return const_cast<Column&>(column(cell_of(p.x(), 0), cell_of(p.y(), 1)));
  };
  for (const auto& p : points) {
    Column& c = column_of(p);
    ++c.end;
    c.levels |= std::uint64_t{1} << level_of(p.z() - lowest_m_, cell_m_);
  }
  std::uint32_t begin = 0;
  for (Column& c : columns_) {
    c.begin = begin;
    begin += c.end;
    c.end = c.begin;
  }
  entries_.resize(points.size());
  for (std::size_t i = 0; i < points.size(); ++i)
    entries_[column_of(points[i]).end++] = {points[i], static_cast<std::uint32_t>(i)};
}

int ColumnGrid::cell_of(float metres, int axis) const { return clamped_floor(metres / cell_m_) - first_[axis]; }

ColumnGrid::Range ColumnGrid::range(float centre, float radius_m, int axis) const {
  return {std::max(0, cell_of(centre - radius_m, axis)), std::min(count_[axis], cell_of(centre + radius_m, axis) + 1)};
}

std::uint64_t ColumnGrid::levels(float low_m, float high_m) const {
  const int low = level_of(low_m - lowest_m_, cell_m_), high = level_of(high_m - lowest_m_, cell_m_);
  const std::uint64_t up_to_high = high == 63 ? ~std::uint64_t{0} : (std::uint64_t{1} << (high + 1)) - 1;
  return up_to_high & ~((std::uint64_t{1} << low) - 1);
}

bool ColumnGrid::nearest(const Eigen::Vector3f& p, float squared_reach_m2, std::size_t& index,
                         float& squared_distance_m2) const {
  if (columns_.empty() || !p.allFinite()) return false;
  const float reach_m = std::sqrt(squared_reach_m2);
  squared_distance_m2 = squared_reach_m2;
  bool found = false;
  // Wider and wider squares, until nothing outside can be nearer than what was found.
  for (float radius_m = std::min(cell_m_, reach_m);; radius_m = std::min(radius_m + cell_m_, reach_m)) {
    const Range x = range(p.x(), radius_m, 0), y = range(p.y(), radius_m, 1);
    const std::uint64_t heights = levels(p.z() - radius_m, p.z() + radius_m);
    for (int i = x.begin; i < x.end; ++i)
      for (int j = y.begin; j < y.end; ++j)
        visit_column(column(i, j), heights, p, squared_distance_m2, [&](std::size_t at, float d2) {
          if (d2 >= squared_distance_m2) return;
          squared_distance_m2 = d2;
          index = at;
          found = true;
        });
    if ((found && squared_distance_m2 <= radius_m * radius_m) || radius_m >= reach_m) return found;
    const bool is_everything =
        x.begin == 0 && y.begin == 0 && x.end == count_[0] && y.end == count_[1] && heights == levels(-1e9f, 1e9f);
    if (is_everything) return found;
  }
}

}  // namespace revisit::registration_internal
