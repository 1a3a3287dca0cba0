// SPDX-License-Identifier: Apache-2.0
#include <revisit/descriptors/similarity.hpp>

#include <cmath>
#include <stdexcept>

#include <revisit/bits/occupancy_bits.h>
#include <revisit/core/pose.hpp>

namespace revisit {

GeometryMatch match_geometry(const DescriptorView& query, const DescriptorView& candidate) {
  if (query.rings != candidate.rings || query.sectors != candidate.sectors || query.cells() == 0)
    throw std::invalid_argument("descriptors of different grids cannot be compared");
  std::uint32_t shift = 0;
  const std::uint32_t distance =
      revisit_bits_min_hamming(query.occupancy, candidate.occupancy, static_cast<std::uint32_t>(query.rings),
                               static_cast<std::uint32_t>(query.sectors), &shift);
  return {1.0 - static_cast<double>(distance) / static_cast<double>(query.cells()), static_cast<int>(shift)};
}

double match_intensity(const DescriptorView& query, const DescriptorView& candidate, int shift_columns) {
  const auto rings = static_cast<std::size_t>(query.rings);
  double sum = 0.0;
  int counted = 0;
  for (int j = 0; j < query.sectors; ++j) {
    const std::uint8_t* q = query.intensity + static_cast<std::size_t>(j) * rings;
    const std::uint8_t* c = candidate.intensity + static_cast<std::size_t>((j + shift_columns) % query.sectors) * rings;
    std::uint32_t qq = 0, cc = 0, qc = 0;
    for (std::size_t i = 0; i < rings; ++i) {
      qq += std::uint32_t{q[i]} * q[i];
      cc += std::uint32_t{c[i]} * c[i];
      qc += std::uint32_t{q[i]} * c[i];
    }
    if (qq == 0 && cc == 0) continue;
    ++counted;
    if (qq != 0 && cc != 0) sum += qc / (std::sqrt(static_cast<double>(qq)) * std::sqrt(static_cast<double>(cc)));
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
