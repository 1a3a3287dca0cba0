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

double seen_share(const DescriptorView& descriptor) {
  const auto rows = static_cast<std::size_t>(descriptor.rows()), sectors = static_cast<std::size_t>(descriptor.sectors);
  std::size_t seen = 0;
  for (std::size_t sector = 0; sector < sectors; ++sector)
    for (std::size_t bit = sector * rows; bit < (sector + 1) * rows; ++bit)
      if ((descriptor.occupancy[bit / 64] >> (bit % 64) & 1u) != 0) {
        ++seen;
        break;
      }
  return sectors == 0 ? 0.0 : static_cast<double>(seen) / static_cast<double>(sectors);
}

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
  if (options.rings < 1 || options.rings > 512 || options.sectors < 1 || options.sectors > 720 || options.levels < 0 ||
      options.levels > 8 || !(options.max_range_m > 0.0))
    throw std::invalid_argument("descriptor grid " + std::to_string(options.rings) + " x " +
                                std::to_string(options.sectors) + " x " + std::to_string(options.levels) + ", " +
                                std::to_string(options.max_range_m) +
                                " m; allowed: 1 to 512 rings, 1 to 720 sectors, 0 to 8 levels, more than 0 m");
  cells_.resize(static_cast<std::size_t>(options.rings) * static_cast<std::size_t>(options.sectors) + 1);
  tops_.resize(cells_.size());
}

void Describer::describe(std::span<const Point> points, IntensityScanContext& result, double ground_z_m) {
  std::fill(cells_.begin(), cells_.end(), std::uint16_t{0});
  std::fill(tops_.begin(), tops_.end(), std::uint8_t{0});
  descriptors_internal::bin_points(points.data(), points.size(),
                                   {options_.rings, options_.sectors, options_.max_range_m},
                                   {static_cast<float>(ground_z_m + LayerConstants::kLowest_m),
                                    static_cast<float>(1.0 / LayerConstants::kStep_m), options_.levels},
                                   cells_.data(), tops_.data());
  result.rings = options_.rings;
  result.sectors = options_.sectors;
  result.levels = options_.levels;
  const std::size_t cells = cells_.size() - 1;
  result.intensity.resize(cells);
  const auto rings = static_cast<std::size_t>(options_.rings), layers = rings == 0 ? 0 : result.rows() / rings;
  result.occupancy.assign(revisit_bits_words(static_cast<std::uint32_t>(cells * layers)), 0);
  for (std::size_t i = 0; i < cells; ++i) {
    const std::uint16_t cell = cells_[i];
    result.intensity[i] = static_cast<std::uint8_t>(cell - (cell != 0));
    const std::size_t top = options_.levels == 0 ? cell != 0 : tops_[i];
    for (std::size_t layer = 0; layer < top; ++layer) {
      const std::size_t bit = i / rings * rings * layers + layer * rings + i % rings;
      result.occupancy[bit / 64] |= std::uint64_t{1} << (bit % 64);
    }
  }
}

IntensityScanContext describe(std::span<const Point> points, const DescriptorOptions& options, double ground_z_m) {
  IntensityScanContext result;
  Describer(options).describe(points, result, ground_z_m);
  return result;
}

}  // namespace revisit
