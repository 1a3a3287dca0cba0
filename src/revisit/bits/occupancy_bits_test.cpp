// SPDX-License-Identifier: Apache-2.0
#include <revisit/bits/occupancy_bits.h>

#include <random>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

namespace {

// The image as one bool a cell, and the distance by definition: an oracle with no packing in it.
struct Image {
  uint32_t rings, sectors;
  std::vector<bool> cells;  // [sector * rings + ring]

  std::vector<uint64_t> packed() const {
    std::vector<uint64_t> words(revisit_bits_words(rings * sectors), 0);
    for (size_t b = 0; b < cells.size(); ++b) words[b / 64] |= uint64_t{cells[b]} << (b % 64);
    return words;
  }
  Image turned(uint32_t shift) const {
    Image result = *this;
    for (uint32_t j = 0; j < sectors; ++j)
      for (uint32_t i = 0; i < rings; ++i) result.cells[((j + shift) % sectors) * rings + i] = cells[j * rings + i];
    return result;
  }
};

Image random_image(uint32_t rings, uint32_t sectors, double density, std::mt19937& generator) {
  Image image{rings, sectors, std::vector<bool>(size_t{rings} * sectors)};
  std::bernoulli_distribution occupied(density);
  for (size_t b = 0; b < image.cells.size(); ++b) image.cells[b] = occupied(generator);
  return image;
}

std::pair<uint32_t, uint32_t> min_hamming_by_definition(const Image& query, const Image& candidate) {
  uint32_t best = UINT32_MAX, best_shift = 0;
  for (uint32_t k = 0; k < query.sectors; ++k) {
    const Image turned = query.turned(k);
    uint32_t distance = 0;
    for (size_t b = 0; b < turned.cells.size(); ++b) distance += turned.cells[b] != candidate.cells[b];
    if (distance < best) best = distance, best_shift = k;
  }
  return {best, best_shift};
}

TEST(OccupancyBits, EqualsDefinitionOnGridsOfAnyShape) {
  std::mt19937 generator(1);
  for (const auto& [rings, sectors] :
       {std::pair{60u, 20u}, {20u, 60u}, {1u, 1u}, {3u, 5u}, {64u, 1u}, {1u, 64u}, {64u, 64u}, {7u, 37u}, {65u, 3u}}) {
    for (int trial = 0; trial < 20; ++trial) {
      const Image query = random_image(rings, sectors, 0.4, generator);
      const Image candidate = random_image(rings, sectors, 0.3, generator);
      uint32_t shift = UINT32_MAX;
      const uint32_t distance =
          revisit_bits_min_hamming(query.packed().data(), candidate.packed().data(), rings, sectors, &shift);
      EXPECT_EQ(std::pair(distance, shift), min_hamming_by_definition(query, candidate)) << rings << " x " << sectors;
    }
  }
}

TEST(OccupancyBits, FindsEveryTurn) {
  std::mt19937 generator(2);
  const Image image = random_image(60, 20, 0.3, generator);
  for (uint32_t k = 0; k < image.sectors; ++k) {
    uint32_t shift = UINT32_MAX;
    EXPECT_EQ(revisit_bits_min_hamming(image.packed().data(), image.turned(k).packed().data(), 60, 20, &shift), 0u);
    EXPECT_EQ(shift, k);
  }
}

}  // namespace
