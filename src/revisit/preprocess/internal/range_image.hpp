// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include <revisit/core/scan.hpp>
#include <revisit/preprocess/rings.hpp>

namespace revisit::preprocess_internal {

/// The scan as an image: row = ring from the lowest, column = azimuth. A pixel holds the nearest of its points.
struct RangeImage {
  struct Pixel {
    float x = 0.f, y = 0.f, z = 0.f;
    float squared_range_m2 = std::numeric_limits<float>::infinity();  ///< infinite where there was no return

    bool is_empty() const { return squared_range_m2 == std::numeric_limits<float>::infinity(); }
  };
  std::size_t rows = 0, columns = 0;
  std::vector<Pixel> pixels;           ///< [row * columns + column]
  std::vector<std::int32_t> pixel_of;  ///< one a point
};

RangeImage make_range_image(const Scan& scan, const Rings& rings);

}  // namespace revisit::preprocess_internal
