// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

#include <revisit/core/scan.hpp>

namespace revisit::descriptors_internal {

struct PolarGrid {
  int rings;
  int sectors;
  double max_range_m;
};

/// Heights in steps: a point at z counts 1 + floor((z - lowest_m) * steps_per_m) levels, at most `count`; 0 below.
struct Levels {
  float lowest_m = 0.f;
  float steps_per_m = 0.f;
  int count = 0;  ///< 0: heights do not matter
};
int levels_of(const Levels& levels, float z);

/// The cell of (x, y) in double arithmetic, as the page defines it: sector * rings + ring, or -1 beyond the range.
int cell_of(const PolarGrid& grid, float x, float y);

/// cells[cell] = max(cells[cell], 1 + quantised intensity) over all points, and tops[cell] = max(tops[cell], its
/// levels). Both are sector-major and have room for rings * sectors + 1 entries: the last collects what lies beyond the
/// range. With SIMD: an approximate cell for several points at once, and cell_of for those that lie near a border, so
/// that the result equals bin_points_scalar bit for bit on every instruction set.
void bin_points(const Point* points, std::size_t count, const PolarGrid& grid, const Levels& levels,
                std::uint16_t* cells, std::uint8_t* tops);

/// The readable reference of bin_points.
void bin_points_scalar(const Point* points, std::size_t count, const PolarGrid& grid, const Levels& levels,
                       std::uint16_t* cells, std::uint8_t* tops);

}  // namespace revisit::descriptors_internal
