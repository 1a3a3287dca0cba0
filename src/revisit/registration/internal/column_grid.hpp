// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

namespace revisit::registration_internal {

/// Points sorted into vertical columns of a square grid, for neighbours within a few cells: LiDAR scans are wide and
/// flat, a column holds few points, and columns side by side along y lie side by side in memory. Exact for points
/// within kFarthest cells of the origin; beyond, points share the outermost columns.
class ColumnGrid {
 public:
  static constexpr int kFarthest = 512;

  ColumnGrid() = default;
  ColumnGrid(std::span<const Eigen::Vector3f> points, float cell_m);

  /// Calls visit(index, squared distance) for the points within `radius_m`, in an order that depends on the points
  /// alone.
  template <typename Visit>
  void for_each_within(const Eigen::Vector3f& p, float radius_m, Visit visit) const {
    const float reach2 = radius_m * radius_m;
    for_each_beside(square(p, radius_m), [&](const Entry& entry) {
      const float d2 = (entry.point - p).squaredNorm();
      if (d2 < reach2) visit(std::size_t{entry.index}, d2);
    });
  }

  /// The nearest point; false where none is nearer than the reach. Of equally near points, any, but always the same.
  bool nearest(const Eigen::Vector3f& p, float squared_reach_m2, std::size_t& index, float& squared_distance_m2) const;

 private:
  struct Entry {
    Eigen::Vector3f point;
    std::uint32_t index;
  };
  struct Square {
    int x_begin, x_end, y_begin, y_end;  ///< columns

    bool operator==(const Square&) const = default;
  };

  int cell_of(float metres) const;  ///< along any axis; column 0 begins at first_
  Square square(const Eigen::Vector3f& centre, float radius_m) const;
  template <typename Visit>
  void for_each_beside(const Square& square, Visit&& visit) const {
    for (int x = square.x_begin; x < square.x_end; ++x) {
      const std::uint32_t* const begin = &begin_[static_cast<std::size_t>(x) * static_cast<std::size_t>(count_[1])];
      for (std::uint32_t e = begin[square.y_begin]; e < begin[square.y_end]; ++e) visit(entries_[e]);
    }
  }

  float cells_per_m_ = 1.f, cell_m_ = 1.f;
  int first_[2] = {}, count_[2] = {};  ///< columns along x and y
  std::vector<std::uint32_t> begin_;   ///< [x][y]: of each column's entries; and the end of the last
  std::vector<Entry> entries_;         ///< by columns
};

}  // namespace revisit::registration_internal
