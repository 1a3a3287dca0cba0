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

/// The cell of (x, y) in double arithmetic, as the page defines it: sector * rings + ring, or -1 beyond the range.
int cell_of(const PolarGrid& grid, float x, float y);

/// cells[cell] = max(cells[cell], 1 + quantised intensity) over all points. `cells` is sector-major and has room for
/// rings * sectors + 1 entries: the last one collects what lies beyond the range.
/// With SIMD: an approximate cell for several points at once, and cell_of for those that lie near a border, so that
/// the result equals bin_points_scalar bit for bit on every instruction set.
void bin_points(const Point* points, std::size_t count, const PolarGrid& grid, std::uint16_t* cells);

/// The readable reference of bin_points.
void bin_points_scalar(const Point* points, std::size_t count, const PolarGrid& grid, std::uint16_t* cells);

}  // namespace revisit::descriptors_internal
