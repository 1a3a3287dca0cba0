// SPDX-License-Identifier: Apache-2.0
#include <revisit/descriptors/internal/contours.hpp>

#include <algorithm>
#include <cmath>
#include <iterator>

namespace revisit::descriptors_internal {
namespace {

constexpr int kCells = 150;
constexpr float kReach_m = kCells / 2.f, kFewestCells = 3.f;

struct Overhead {
  std::vector<ContourMap::Top> tops =
      std::vector<ContourMap::Top>(std::size_t{kCells} * kCells, {Eigen::Vector2f::Zero(), 0.f});

  Overhead(std::span<const Point> points, float ground_z_m) {
    for (const Point& p : points) {
      if (!(std::abs(p.x) < kReach_m) || !(std::abs(p.y) < kReach_m) || !std::isfinite(p.z)) continue;
      const auto cell = [](float metres) {
        return static_cast<std::size_t>(std::min(static_cast<int>(metres + kReach_m), kCells - 1));
      };
      ContourMap::Top& top = tops[cell(p.x) * kCells + cell(p.y)];
      if (p.z - ground_z_m > top.height_m) top = {{p.x, p.y}, p.z - ground_z_m};
    }
  }
};

// The cells higher than the level that hang together with `first`, over edges and corners; marks them as met.
std::vector<std::size_t> grow(const Overhead& view, float level_m, std::size_t first, std::vector<bool>& is_met) {
  std::vector<std::size_t> cells{first};
  is_met[first] = true;
  for (std::size_t next = 0; next < cells.size(); ++next) {
    const auto i = static_cast<int>(cells[next] / kCells), j = static_cast<int>(cells[next] % kCells);
    for (int row = std::max(0, i - 1); row <= std::min(kCells - 1, i + 1); ++row)
      for (int column = std::max(0, j - 1); column <= std::min(kCells - 1, j + 1); ++column) {
        const auto cell = static_cast<std::size_t>(row) * kCells + static_cast<std::size_t>(column);
        if (is_met[cell] || view.tops[cell].height_m < level_m) continue;
        is_met[cell] = true;
        cells.push_back(cell);
      }
  }
  return cells;
}

Contour contour_of(const Overhead& view, const std::vector<std::size_t>& cells, int level) {
  Contour contour;
  contour.level = level;
  contour.cells = static_cast<float>(cells.size());
  Eigen::Matrix2f products = Eigen::Matrix2f::Zero();
  for (const std::size_t cell : cells) {
    contour.centre += view.tops[cell].position / contour.cells;
    contour.height_m += view.tops[cell].height_m / contour.cells;
  }
  for (const std::size_t cell : cells) {
    const Eigen::Vector2f off = view.tops[cell].position - contour.centre;
    products += off * off.transpose();
  }
  constexpr float kWithinCell_m2 = 1.f / 12.f;
  contour.covariance = products / contour.cells + Eigen::Matrix2f::Identity() * kWithinCell_m2;
  return contour;
}

}  // namespace

ContourMap find_contours(std::span<const Point> points, float ground_z_m) {
  const Overhead view(points, ground_z_m);
  ContourMap map;
  std::copy_if(view.tops.begin(), view.tops.end(), std::back_inserter(map.tops),
               [](const ContourMap::Top& top) { return top.height_m >= kContourLevels_m.front(); });
  for (std::size_t level = 0; level < kContourLevels_m.size(); ++level) {
    std::vector<bool> is_met(view.tops.size());
    std::vector<Contour>& contours = map.contours[level];
    for (std::size_t cell = 0; cell < view.tops.size(); ++cell) {
      if (is_met[cell] || view.tops[cell].height_m < kContourLevels_m[level]) continue;
      const Contour contour =
          contour_of(view, grow(view, kContourLevels_m[level], cell, is_met), static_cast<int>(level));
      if (contour.cells >= kFewestCells) contours.push_back(contour);
    }
    std::stable_sort(contours.begin(), contours.end(),
                     [](const Contour& a, const Contour& b) { return a.cells > b.cells; });
  }
  return map;
}

}  // namespace revisit::descriptors_internal
