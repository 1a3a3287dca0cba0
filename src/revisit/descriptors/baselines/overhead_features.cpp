// SPDX-License-Identifier: Apache-2.0
#include <revisit/descriptors/internal/overhead_features.hpp>

#include <algorithm>
#include <cmath>
#include <vector>

#include <Eigen/Eigenvalues>

namespace revisit::descriptors_internal {
namespace {

constexpr float kFewestPoints = 5.f;

struct Moments {
  float count = 0.f;
  Eigen::Vector3f sum = Eigen::Vector3f::Zero();
  Eigen::Matrix3f products = Eigen::Matrix3f::Zero();

  void operator+=(const Moments& other) {
    count += other.count;
    sum += other.sum;
    products += other.products;
  }
};

std::size_t index_of(const OverheadGrid& grid, int i, int j) {
  return static_cast<std::size_t>(i) * static_cast<std::size_t>(grid.cells) + static_cast<std::size_t>(j);
}

// A cell after the other, from those of the lowest x on.
std::vector<Moments> moments_of(std::span<const Point> points, const OverheadGrid& grid, float lowest_m) {
  std::vector<Moments> moments(static_cast<std::size_t>(grid.cells) * static_cast<std::size_t>(grid.cells));
  const auto cell = [&](float metres) {
    const float place = (metres / grid.reach_m + 1.f) * static_cast<float>(grid.cells) / 2.f;
    return static_cast<std::size_t>(std::clamp(static_cast<int>(place), 0, grid.cells - 1));
  };
  for (const Point& p : points) {
    if (!(p.z >= lowest_m) || !(std::abs(p.x) < grid.reach_m) || !(std::abs(p.y) < grid.reach_m)) continue;
    Moments& of_cell = moments[cell(p.x) * static_cast<std::size_t>(grid.cells) + cell(p.y)];
    const Eigen::Vector3f position(p.x, p.y, p.z);
    of_cell.count += 1.f;
    of_cell.sum += position;
    of_cell.products += position * position.transpose();
  }
  return moments;
}

Eigen::Vector2f centre_of(const OverheadGrid& grid, int i, int j) {
  const auto metres = [&](int cell) {
    return ((static_cast<float>(cell) + 0.5f) * 2.f / static_cast<float>(grid.cells) - 1.f) * grid.reach_m;
  };
  return {metres(i), metres(j)};
}

Eigen::Vector<float, 6> features_of(const Moments& around) {
  const Eigen::Vector3f mean = around.sum / around.count;
  const Eigen::Matrix3f covariance = around.products / around.count - mean * mean.transpose();
  Eigen::Vector3f values =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix3f>(covariance, Eigen::EigenvaluesOnly).eigenvalues().cwiseMax(1e-6f);
  values /= values.sum();
  const float smallest = values[0], middle = values[1], largest = values[2];
  Eigen::Vector<float, 6> features;
  features << (largest - middle) / largest, (middle - smallest) / largest, smallest / largest,
      std::cbrt(smallest * middle * largest), -(values.array() * values.array().log()).sum(), smallest;
  return features;
}

// `feature_of(i, j)`: of an occupied cell; whether it has any.
template <typename FeatureOf>
OverheadCells collect(const std::vector<Moments>& moments, const OverheadGrid& grid, Eigen::Index channels,
                      FeatureOf feature_of) {
  OverheadCells cells;
  const auto room = static_cast<Eigen::Index>(
      std::count_if(moments.begin(), moments.end(), [](const Moments& each) { return each.count > 0.f; }));
  cells.centres.resize(2, room);
  cells.features.resize(channels, room);
  Eigen::Index used = 0;
  for (int i = 0; i < grid.cells; ++i)
    for (int j = 0; j < grid.cells; ++j) {
      if (moments[index_of(grid, i, j)].count == 0.f) continue;
      if (!feature_of(i, j, cells.features.col(used))) continue;
      cells.centres.col(used++) = centre_of(grid, i, j);
    }
  cells.centres.conservativeResize(2, used);
  cells.features.conservativeResize(channels, used);
  return cells;
}

}  // namespace

OverheadCells occupied_cells(std::span<const Point> points, const OverheadGrid& grid, float lowest_m) {
  return collect(moments_of(points, grid, lowest_m), grid, 1, [](int, int, auto feature) {
    feature.setOnes();
    return true;
  });
}

OverheadCells eigenvalue_features(std::span<const Point> points, const OverheadGrid& grid, float lowest_m) {
  const std::vector<Moments> moments = moments_of(points, grid, lowest_m);
  return collect(moments, grid, 6, [&](int i, int j, auto feature) {
    Moments around;
    for (int row = std::max(0, i - 1); row <= std::min(grid.cells - 1, i + 1); ++row)
      for (int column = std::max(0, j - 1); column <= std::min(grid.cells - 1, j + 1); ++column)
        around += moments[index_of(grid, row, column)];
    if (around.count < kFewestPoints) return false;
    feature = features_of(around);
    return true;
  });
}

}  // namespace revisit::descriptors_internal
