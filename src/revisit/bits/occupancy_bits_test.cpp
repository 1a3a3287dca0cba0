// SPDX-License-Identifier: Apache-2.0
#include <revisit/bits/occupancy_bits.h>

#include <algorithm>
#include <cstdlib>
#include <random>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include <revisit/bits/instruction_sets.hpp>

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

std::vector<uint64_t> turned(const Image& query) {
  std::vector<uint64_t> words(revisit_bits_turned_words(query.rings, query.sectors));
  revisit_bits_turn(query.packed().data(), query.rings, query.sectors, words.data());
  return words;
}

using revisit::force_instruction_set;
using revisit::supported_instruction_sets;

class EveryInstructionSet : public testing::Test {
 protected:
  ~EveryInstructionSet() override { force_instruction_set(0); }
};

TEST_F(EveryInstructionSet, FindsTheDistanceAndShiftOfTheReference) {
  std::mt19937 generator(3);
  for (const int64_t target : supported_instruction_sets()) {
    force_instruction_set(target);
    SCOPED_TRACE(revisit::instruction_set_name());
    for (const auto& grid : {std::pair{60u, 20u},
                             {20u, 60u},
                             {1u, 1u},
                             {3u, 5u},
                             {64u, 1u},
                             {1u, 64u},
                             {64u, 64u},
                             {7u, 37u},
                             {65u, 130u}})
      for (int trial = 0; trial < 10; ++trial) {
        const uint32_t rings = grid.first, sectors = grid.second;
        const Image query = random_image(rings, sectors, 0.4, generator);
        // Unlike, alike, and turned: the last have several shifts of equal distance.
        Image candidate = trial < 4 ? random_image(rings, sectors, 0.3, generator) : query.turned(trial % sectors);
        if (trial >= 7) candidate.cells[0] = !candidate.cells[0];
        uint32_t expected_shift = 0, shift = UINT32_MAX;
        const uint32_t expected =
            revisit_bits_min_hamming(query.packed().data(), candidate.packed().data(), rings, sectors, &expected_shift);
        const auto distance = [&](uint32_t limit) {
          return revisit_bits_min_hamming_turned(turned(query).data(), candidate.packed().data(), rings, sectors, limit,
                                                 &shift);
        };
        ASSERT_EQ(distance(UINT32_MAX), expected) << rings << " x " << sectors;
        ASSERT_EQ(shift, expected_shift);
        ASSERT_EQ(distance(expected + 1), expected) << "just below the limit";
        ASSERT_EQ(shift, expected_shift);
        shift = 77777;
        ASSERT_EQ(distance(expected), UINT32_MAX) << "not below the limit";
        ASSERT_EQ(shift, 77777u);
      }
  }
}

// The bound by definition: sectors taken together, for each turn of the query.
uint32_t bound_by_definition(const Image& query, const Image& place) {
  const uint32_t columns = std::min(query.sectors, uint32_t{REVISIT_BITS_COLUMNS});
  const auto count = [&](const Image& image) {
    std::vector<int> counts(columns);
    for (uint32_t j = 0; j < image.sectors; ++j)
      for (uint32_t i = 0; i < image.rings; ++i)
        counts[j * columns / image.sectors] += image.cells[j * image.rings + i];
    for (int& each : counts) each = std::min(each, 255);
    return counts;
  };
  uint32_t least = 255;
  for (uint32_t k = 0; k < query.sectors; ++k) {
    const auto q = count(query.turned(k)), c = count(place);
    uint32_t sum = 0;
    for (uint32_t g = 0; g < columns; ++g) sum += static_cast<uint32_t>(std::abs(q[g] - c[g]));
    least = std::min(least, sum);
  }
  return least;
}

TEST_F(EveryInstructionSet, BoundsAreThoseOfTheDefinitionAndNeverAboveTheDistance) {
  std::mt19937 generator(4);
  for (const auto& [rings, sectors] : {std::pair{60u, 20u}, {20u, 60u}, {3u, 5u}, {64u, 64u}, {7u, 37u}}) {
    constexpr size_t kPlaces = size_t{2} * REVISIT_BITS_BLOCK;
    const Image query = random_image(rings, sectors, 0.5, generator);
    std::vector<uint8_t> turned_columns(revisit_bits_turned_columns_bytes(sectors));
    revisit_bits_turn_columns(query.packed().data(), rings, sectors, turned_columns.data());
    std::vector<uint8_t> counts(kPlaces * REVISIT_BITS_COLUMNS), bounds(kPlaces);
    std::vector<uint32_t> expected(kPlaces);
    for (size_t i = 0; i < kPlaces; ++i) {
      const Image place = i % 3 == 0 ? query.turned(static_cast<uint32_t>(i) % sectors)
                                     : random_image(rings, sectors, 0.008 * static_cast<double>(i), generator);
      uint8_t c[REVISIT_BITS_COLUMNS];
      revisit_bits_columns(place.packed().data(), rings, sectors, c);
      for (size_t column = 0; column < REVISIT_BITS_COLUMNS; ++column)
        counts[(i / 64 * REVISIT_BITS_COLUMNS + column) * 64 + i % 64] = c[column];
      expected[i] = bound_by_definition(query, place);
      uint32_t shift = 0;
      EXPECT_LE(expected[i],
                revisit_bits_min_hamming(query.packed().data(), place.packed().data(), rings, sectors, &shift));
    }
    for (const int64_t target : supported_instruction_sets()) {
      force_instruction_set(target);
      revisit_bits_bounds(turned_columns.data(), sectors, counts.data(), kPlaces / REVISIT_BITS_BLOCK, bounds.data());
      for (size_t i = 0; i < kPlaces; ++i) ASSERT_EQ(bounds[i], expected[i]) << i;
      force_instruction_set(0);
    }
  }
}

TEST_F(EveryInstructionSet, ForcingOneChangesWhatRuns) {
  std::set<size_t> lanes;
  std::set<std::string> names;
  const auto targets = supported_instruction_sets();
  for (const int64_t target : targets) {
    force_instruction_set(target);
    lanes.insert(revisit::instruction_set_lanes());
    names.insert(revisit::instruction_set_name());
  }
  EXPECT_EQ(names.size(), targets.size());
  if (targets.size() > 3) {
    EXPECT_GT(lanes.size(), 1u) << "vectors of 128, 256, 512 bits";
  }
}

}  // namespace
