// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include <revisit/core/scan.hpp>
#include <revisit/preprocess/rings.hpp>

namespace revisit::preprocess_internal {

/// The scan as an image: row = ring from the lowest, column = azimuth. Each pixel names the nearest of its points.
struct RangeImage {
  static constexpr std::int32_t kEmpty = -1;
  std::size_t rows = 0, columns = 0;
  std::vector<std::int32_t> point_at;  ///< [row * columns + column], kEmpty where there was no return
  std::vector<std::int32_t> pixel_of;  ///< one a point

  std::int32_t at(std::size_t row, std::size_t column) const { return point_at[row * columns + column]; }
};

RangeImage make_range_image(const Scan& scan, const Rings& rings);

}  // namespace revisit::preprocess_internal
