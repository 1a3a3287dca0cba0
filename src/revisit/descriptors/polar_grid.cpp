// SPDX-License-Identifier: Apache-2.0
// Apart from polar_binning.cpp, which is compiled once an instruction set: here rounding is the same everywhere.
#include <algorithm>
#include <cmath>

#include <revisit/descriptors/intensity_scan_context.hpp>
#include <revisit/descriptors/internal/polar_binning.hpp>

namespace revisit::descriptors_internal {

int cell_of(const PolarGrid& grid, float x, float y) {
  constexpr double kPi = 3.14159265358979323846;
  const double rho = std::sqrt(static_cast<double>(x) * x + static_cast<double>(y) * y);
  const double theta = std::atan2(static_cast<double>(y), static_cast<double>(x));
  const double ring = std::floor(rho * grid.rings / grid.max_range_m);
  if (!(ring < grid.rings)) return -1;  // too far, or not a number
  const auto sector = static_cast<int>(std::floor((theta + kPi) * grid.sectors / (2.0 * kPi)));
  return (sector % grid.sectors) * grid.rings + static_cast<int>(ring);  // theta = pi is sector 0
}

int levels_of(const Levels& levels, float z) {
  const float steps = (z - levels.lowest_m) * levels.steps_per_m;
  if (levels.count == 0 || !(steps >= 0.f)) return 0;
  return 1 + static_cast<int>(std::min(std::floor(steps), static_cast<float>(levels.count - 1)));
}

void bin_points_scalar(const Point* points, std::size_t count, const PolarGrid& grid, const Levels& levels,
                       std::uint16_t* cells, std::uint8_t* tops) {
  for (std::size_t i = 0; i < count; ++i) {
    const int cell = cell_of(grid, points[i].x, points[i].y);
    if (cell < 0) continue;
    const auto value = static_cast<std::uint16_t>(1 + quantise_intensity(points[i].intensity));
    cells[cell] = std::max(cells[cell], value);
    tops[cell] = std::max(tops[cell], static_cast<std::uint8_t>(levels_of(levels, points[i].z)));
  }
}

}  // namespace revisit::descriptors_internal
