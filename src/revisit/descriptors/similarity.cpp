// SPDX-License-Identifier: Apache-2.0
#include <revisit/descriptors/similarity.hpp>

#include <bit>
#include <cmath>
#include <stdexcept>

#include <revisit/bits/occupancy_bits.h>
#include <revisit/core/pose.hpp>

namespace revisit {

namespace {

std::size_t occupied(const DescriptorView& descriptor) {
  const std::size_t bits = static_cast<std::size_t>(descriptor.rows()) * static_cast<std::size_t>(descriptor.sectors);
  std::size_t count = 0;
  for (std::size_t w = 0; w < revisit_bits_words(static_cast<std::uint32_t>(bits)); ++w)
    count += static_cast<std::size_t>(std::popcount(descriptor.occupancy[w]));
  return count;
}

}  // namespace

double geometry_score(const DescriptorView& query, const DescriptorView& candidate, std::uint32_t differing_cells) {
  const auto differing = static_cast<double>(differing_cells);
  if (query.levels == 0) return 1.0 - differing / static_cast<double>(query.cells());
  const std::size_t in_both = occupied(query) + occupied(candidate);
  return in_both == 0 ? 0.0 : 1.0 - differing / static_cast<double>(in_both);
}

GeometryMatch match_geometry(const DescriptorView& query, const DescriptorView& candidate) {
  if (query.rings != candidate.rings || query.sectors != candidate.sectors || query.levels != candidate.levels ||
      query.cells() == 0)
    throw std::invalid_argument("descriptors of different grids cannot be compared");
  std::uint32_t shift = 0;
  const std::uint32_t distance =
      revisit_bits_min_hamming(query.occupancy, candidate.occupancy, static_cast<std::uint32_t>(query.rows()),
                               static_cast<std::uint32_t>(query.sectors), &shift);
  return {geometry_score(query, candidate, distance), static_cast<int>(shift)};
}

double match_intensity(const DescriptorView& query, const DescriptorView& candidate, int shift_columns) {
  // Integers in SIMD; only the quotients are floating point.
  constexpr std::size_t kMostSectors = 720;
  std::uint32_t products[3 * kMostSectors];
  const auto sectors = static_cast<std::size_t>(query.sectors);
  if (sectors > kMostSectors) throw std::invalid_argument("descriptors have up to 720 sectors");
  revisit_bits_sector_products(query.intensity, candidate.intensity, static_cast<std::uint32_t>(query.rings),
                               static_cast<std::uint32_t>(sectors), static_cast<std::uint32_t>(shift_columns),
                               products);
  double sum = 0.0;
  int counted = 0;
  for (std::size_t j = 0; j < sectors; ++j) {
    const double qq = products[3 * j], cc = products[3 * j + 1], qc = products[3 * j + 2];
    if (qq == 0.0 && cc == 0.0) continue;
    ++counted;
    if (qq != 0.0 && cc != 0.0) sum += qc / std::sqrt(qq * cc);  // the product is exact: below 2^53
  }
  return counted == 0 ? 0.0 : sum / counted;
}

double yaw_of_shift(int shift_columns, int sectors) { return wrap_angle(shift_columns * 2.0 * kPi / sectors); }

LoopCandidate match_descriptors(const DescriptorView& query, const DescriptorView& candidate) {
  const GeometryMatch geometry = match_geometry(query, candidate);
  LoopCandidate result;
  result.geometry_score = geometry.score;
  result.shift_columns = geometry.shift_columns;
  result.intensity_score = match_intensity(query, candidate, geometry.shift_columns);
  result.yaw_rad = yaw_of_shift(geometry.shift_columns, query.sectors);
  return result;
}

}  // namespace revisit
