// SPDX-License-Identifier: Apache-2.0
#include <revisit/descriptors/intensity_scan_context.hpp>

#include <algorithm>
#include <bit>
#include <cmath>
#include <stdexcept>
#include <string>

#include <revisit/bits/occupancy_bits.h>
#include <revisit/descriptors/internal/polar_binning.hpp>

namespace revisit {

int IntensityScanContext::occupied_cells() const {
  int count = 0;
  for (const std::uint64_t word : occupancy) count += std::popcount(word);
  return count;
}

std::uint8_t quantise_intensity(float intensity) {
  if (!(intensity > 0.f)) return 0;
  // One rounding only, so that a fused multiply-add cannot change it.
  return static_cast<std::uint8_t>(std::lrint(std::min(intensity, 1.f) * 255.f));
}

Describer::Describer(const DescriptorOptions& options) : options_(options) {
  if (options.rings < 1 || options.rings > 512 || options.sectors < 1 || options.sectors > 720 ||
      !(options.max_range_m > 0.0))
    throw std::invalid_argument("descriptor grid " + std::to_string(options.rings) + " x " +
                                std::to_string(options.sectors) + ", " + std::to_string(options.max_range_m) +
                                " m; allowed: 1 to 512 rings, 1 to 720 sectors, more than 0 m");
  cells_.resize(static_cast<std::size_t>(options.rings) * static_cast<std::size_t>(options.sectors) + 1);
}

void Describer::describe(std::span<const Point> points, IntensityScanContext& result) {
  std::fill(cells_.begin(), cells_.end(), std::uint16_t{0});
  descriptors_internal::bin_points(points.data(), points.size(),
                                   {options_.rings, options_.sectors, options_.max_range_m}, cells_.data());
  result.rings = options_.rings;
  result.sectors = options_.sectors;
  const std::size_t cells = cells_.size() - 1;
  result.intensity.resize(cells);
  result.occupancy.assign(revisit_bits_words(static_cast<std::uint32_t>(cells)), 0);
  for (std::size_t i = 0; i < cells; ++i) {
    const std::uint16_t cell = cells_[i];
    result.intensity[i] = static_cast<std::uint8_t>(cell - (cell != 0));
    result.occupancy[i / 64] |= std::uint64_t{cell != 0} << (i % 64);
  }
}

IntensityScanContext describe(std::span<const Point> points, const DescriptorOptions& options) {
  IntensityScanContext result;
  Describer(options).describe(points, result);
  return result;
}

}  // namespace revisit
