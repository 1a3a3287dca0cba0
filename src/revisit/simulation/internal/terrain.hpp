// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include <revisit/simulation/internal/path.hpp>
#include <revisit/simulation/internal/solid.hpp>

namespace revisit::simulation_internal {

/// The ground as a grid of heights: it follows the path, and hills rise beside it.
class Terrain {
 public:
  static constexpr double kCell_m = 4.0;

  /// One square of the ground with the heights of its corners (x low/high, y low/high).
  struct Cell {
    float x, y, h00, h10, h01, h11;
  };

  /// Cells within `reach_m` of the path; hills of up to `hills_m` start some 25 m from it.
  Terrain(const Path& path, double reach_m, double hills_m, std::uint64_t seed);

  double height(double x, double y) const;
  const std::vector<Cell>& cells() const { return cells_; }
  double x_min() const { return x_min_; }
  double y_min() const { return y_min_; }
  int columns() const { return columns_; }
  int rows() const { return rows_; }

 private:
  float& vertex(int column, int row) {
    return heights_[static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) +
                    static_cast<std::size_t>(column)];
  }
  float vertex(int column, int row) const { return const_cast<Terrain*>(this)->vertex(column, row); }

  double x_min_, y_min_;
  int columns_, rows_;
  std::vector<float> heights_;
  std::vector<Cell> cells_;
};

/// Where the ray meets the cell before `limit_m`; infinity where it does not. `normal` is filled in if given.
float intersect(const Terrain::Cell& cell, const Ray& ray, float limit_m, Eigen::Vector3f* normal = nullptr);

}  // namespace revisit::simulation_internal
