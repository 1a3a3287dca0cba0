// SPDX-License-Identifier: Apache-2.0
#include <revisit/simulation/internal/roads.hpp>

#include <algorithm>
#include <cmath>
#include <unordered_map>

#include <revisit/simulation/internal/random.hpp>

namespace revisit::simulation_internal {
namespace {

constexpr double kSpacing_m = 1.5;
constexpr float kReach_m = 12.f, kCell_m = 2.f;

// Points each 1.5 m; a lane that is driven again is kept once.
std::vector<LanePoint> thin(const std::vector<std::vector<Knot>>& lanes) {
  std::vector<LanePoint> points;
  std::unordered_map<std::uint64_t, std::vector<std::uint32_t>> by_cell;
  const auto key = [](int x, int y) {
    return (static_cast<std::uint64_t>(static_cast<std::uint32_t>(x)) << 32) | static_cast<std::uint32_t>(y);
  };
  double arc_m = 0.0, next_m = 0.0;
  for (const auto& lane : lanes)
    for (std::size_t i = 0; i + 1 < lane.size(); ++i) {
      const double length = std::hypot(lane[i + 1].x - lane[i].x, lane[i + 1].y - lane[i].y);
      for (; next_m < arc_m + length; next_m += kSpacing_m) {
        const double t = (next_m - arc_m) / length;
        const double x = lane[i].x + t * (lane[i + 1].x - lane[i].x), y = lane[i].y + t * (lane[i + 1].y - lane[i].y);
        const LanePoint point{static_cast<float>(x), static_cast<float>(y),
                              static_cast<float>(std::cos(lane[i].yaw_rad)),
                              static_cast<float>(std::sin(lane[i].yaw_rad)), static_cast<float>(next_m)};
        const int column = floor_int(x / 2.0), row = floor_int(y / 2.0);
        bool is_known = false;
        for (int dc = -1; dc <= 1; ++dc)
          for (int dr = -1; dr <= 1; ++dr)
            for (const std::uint32_t other : by_cell[key(column + dc, row + dr)]) {
              const LanePoint& o = points[other];
              is_known |= std::hypot(o.x - point.x, o.y - point.y) < 0.9f &&
                          o.cos_yaw * point.cos_yaw + o.sin_yaw * point.sin_yaw > 0.9f;
            }
        if (is_known) continue;
        by_cell[key(column, row)].push_back(static_cast<std::uint32_t>(points.size()));
        points.push_back(point);
      }
      arc_m += length;
    }
  return points;
}

}  // namespace

Roads::Roads(const std::vector<std::vector<Knot>>& lanes, const Terrain& grid)
    : points_(thin(lanes)), x_min_(static_cast<float>(grid.x_min())), y_min_(static_cast<float>(grid.y_min())) {
  columns_ = static_cast<int>(static_cast<float>(grid.columns()) * static_cast<float>(Terrain::kCell_m) / kCell_m);
  rows_ = static_cast<int>(static_cast<float>(grid.rows()) * static_cast<float>(Terrain::kCell_m) / kCell_m);
  first_.resize(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_) + 1);
  const auto for_each_near = [this](auto visit) {
    constexpr int kReach = static_cast<int>(kReach_m / kCell_m) + 1;
    for (std::uint32_t i = 0; i < points_.size(); ++i) {
      const int column = floor_int((points_[i].x - x_min_) / kCell_m),
                row = floor_int((points_[i].y - y_min_) / kCell_m);
      for (int r = std::max(0, row - kReach); r <= std::min(rows_ - 1, row + kReach); ++r)
        for (int c = std::max(0, column - kReach); c <= std::min(columns_ - 1, column + kReach); ++c) {
          const float dx = x_min_ + (static_cast<float>(c) + 0.5f) * kCell_m - points_[i].x;
          const float dy = y_min_ + (static_cast<float>(r) + 0.5f) * kCell_m - points_[i].y;
          visit(static_cast<std::size_t>(r) * static_cast<std::size_t>(columns_) + static_cast<std::size_t>(c), i,
                std::sqrt(dx * dx + dy * dy));
        }
    }
  };
  // A point can be the nearest to some place in a cell only if, seen from the cell's middle, it is at most the cell's
  // diagonal farther away than the nearest one.
  std::vector<float> least(first_.size(), kReach_m + kCell_m);
  const auto is_kept = [&](std::size_t cell, float distance) { return distance <= least[cell] + 1.4143f * kCell_m; };
  for_each_near(
      [&](std::size_t cell, std::uint32_t, float distance) { least[cell] = std::min(least[cell], distance); });
  for_each_near([&](std::size_t cell, std::uint32_t, float distance) { first_[cell + 1] += is_kept(cell, distance); });
  for (std::size_t i = 1; i < first_.size(); ++i) first_[i] += first_[i - 1];
  near_.resize(first_.back());
  std::vector<std::uint32_t> next = first_;
  for_each_near([&](std::size_t cell, std::uint32_t point, float distance) {
    if (is_kept(cell, distance)) near_[next[cell]++] = points_[point];
  });
}

std::optional<Roads::Place> Roads::nearest(float x, float y) const {
  const int column = floor_int((x - x_min_) / kCell_m), row = floor_int((y - y_min_) / kCell_m);
  if (column < 0 || row < 0 || column >= columns_ || row >= rows_) return std::nullopt;
  const auto cell =
      static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) + static_cast<std::size_t>(column);
  float best = kReach_m * kReach_m;
  const LanePoint* found = nullptr;
  for (std::uint32_t k = first_[cell]; k < first_[cell + 1]; ++k) {
    const LanePoint& p = near_[k];
    const float distance2 = (x - p.x) * (x - p.x) + (y - p.y) * (y - p.y);
    if (distance2 < best) {
      best = distance2;
      found = &p;
    }
  }
  if (found == nullptr) return std::nullopt;
  const float dx = x - found->x, dy = y - found->y;
  return Place{found->cos_yaw * dy - found->sin_yaw * dx, found->arc_m + found->cos_yaw * dx + found->sin_yaw * dy};
}

}  // namespace revisit::simulation_internal
