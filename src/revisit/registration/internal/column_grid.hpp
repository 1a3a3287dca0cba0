// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

namespace revisit::registration_internal {

/// Points sorted into vertical columns of a square grid, for neighbours within a few cells. LiDAR scans are wide and
/// flat: a column holds few points, and 64 bits say at which heights. Exact for points within kFarthest cells of the
/// origin; beyond, points share the outermost columns.
class ColumnGrid {
 public:
  static constexpr int kFarthest = 512;

  ColumnGrid() = default;
  ColumnGrid(std::span<const Eigen::Vector3f> points, float cell_m);

  /// Calls visit(index, squared distance) for the points within `radius_m`, in an order that depends on the points
  /// alone.
  template <typename Visit>
  void for_each_within(const Eigen::Vector3f& p, float radius_m, Visit visit) const {
    const Range x = range(p.x(), radius_m, 0), y = range(p.y(), radius_m, 1);
    const std::uint64_t heights = levels(p.z() - radius_m, p.z() + radius_m);
    const float reach2 = radius_m * radius_m;
    for (int i = x.begin; i < x.end; ++i)
      for (int j = y.begin; j < y.end; ++j) visit_column(column(i, j), heights, p, reach2, visit);
  }

  /// The nearest point; false where none is nearer than the reach. Of equally near points, any, but always the same.
  bool nearest(const Eigen::Vector3f& p, float squared_reach_m2, std::size_t& index, float& squared_distance_m2) const;

 private:
  struct Range {
    int begin, end;
  };
  struct Column {
    std::uint64_t levels = 0;  ///< bit k: a point at height level k
    std::uint32_t begin = 0, end = 0;
  };
  struct Entry {
    Eigen::Vector3f point;
    std::uint32_t index;
  };

  int cell_of(float metres, int axis) const;
  Range range(float centre, float radius_m, int axis) const;
  std::uint64_t levels(float low_m, float high_m) const;
  const Column& column(int i, int j) const {
    return columns_[static_cast<std::size_t>(i) * static_cast<std::size_t>(count_[1]) + static_cast<std::size_t>(j)];
  }
  template <typename Visit>
  void visit_column(const Column& c, std::uint64_t heights, const Eigen::Vector3f& p, float reach2,
                    Visit&& visit) const {
    if ((c.levels & heights) == 0) return;
    for (std::uint32_t e = c.begin; e < c.end; ++e) {
      const float d2 = (entries_[e].point - p).squaredNorm();
      if (d2 < reach2) visit(std::size_t{entries_[e].index}, d2);
    }
  }

  float cell_m_ = 1.f, lowest_m_ = 0.f;
  int first_[2] = {}, count_[2] = {};  ///< columns along x and y
  std::vector<Column> columns_;        ///< [x][y]
  std::vector<Entry> entries_;         ///< by columns
};

}  // namespace revisit::registration_internal
