// SPDX-License-Identifier: Apache-2.0
#include <revisit/bits/occupancy_bits.h>

#include <algorithm>
#include <cmath>
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

// A prepared query with the memory it points to.
struct Prepared {
  explicit Prepared(const Image& image)
      : memory(revisit_bits_query_bytes(image.rings, image.sectors) + 64),
        start((reinterpret_cast<uintptr_t>(memory.data()) + 63) / 64 * 64) {
    revisit_bits_prepare(image.packed().data(), image.rings, image.sectors, reinterpret_cast<void*>(start), &query);
  }
  std::vector<uint8_t> memory;
  uintptr_t start;
  revisit_bits_query query{};
};

// Places one after the other, as revisit_bits_compare reads them.
class Row {
 public:
  Row(uint32_t rings, uint32_t sectors)
      : rings_(rings), sectors_(sectors), bytes_(revisit_bits_place_bytes(rings, sectors)) {}
  std::vector<uint8_t> add(const Image& image) {
    std::vector<uint8_t> columns(REVISIT_BITS_COLUMNS);
    row_.resize(row_.size() + bytes_ / 8);
    revisit_bits_make_place(image.packed().data(), rings_, sectors_,
                            reinterpret_cast<revisit_bits_place*>(row_.data() + row_.size() - bytes_ / 8),
                            columns.data());
    return columns;
  }
  const revisit_bits_place* begin() const { return reinterpret_cast<const revisit_bits_place*>(row_.data()); }
  const revisit_bits_place* last() const {
    return reinterpret_cast<const revisit_bits_place*>(row_.data() + row_.size() - bytes_ / 8);
  }
  size_t bytes() const { return bytes_; }

 private:
  uint32_t rings_, sectors_;
  size_t bytes_;
  std::vector<uint64_t> row_;
};

using revisit::force_instruction_set;
using revisit::supported_instruction_sets;

class EveryInstructionSet : public testing::Test {
 protected:
  ~EveryInstructionSet() override { force_instruction_set(0); }
};

TEST_F(EveryInstructionSet, FindsTheDistanceAndShiftOfTheReference) {
  std::mt19937 generator(3);
  for (const auto& grid : {std::pair{60u, 20u},
                           {20u, 60u},
                           {1u, 1u},
                           {3u, 5u},
                           {64u, 1u},
                           {1u, 64u},
                           {64u, 64u},
                           {7u, 37u},
                           {65u, 130u}}) {
    const uint32_t rings = grid.first, sectors = grid.second;
    SCOPED_TRACE(std::to_string(rings) + " x " + std::to_string(sectors));
    const Image query = random_image(rings, sectors, 0.4, generator);
    const Prepared prepared(query);
    Row row(rings, sectors);
    uint32_t expected[64], expected_shift[64], at_some_turn[64];
    for (uint32_t i = 0; i < 64; ++i) {
      // Unlike, alike, and turned: the last have several shifts of equal distance.
      Image place = i % 4 == 0 ? query.turned(i % sectors) : random_image(rings, sectors, 0.01 * i, generator);
      if (i % 8 == 0) place.cells[0] = !place.cells[0];
      row.add(place);
      expected[i] =
          revisit_bits_min_hamming(query.packed().data(), place.packed().data(), rings, sectors, &expected_shift[i]);
      at_some_turn[i] = revisit_bits_hamming_at_promising_turn(&prepared.query, row.last());
      EXPECT_GE(at_some_turn[i], expected[i]);
    }
    const uint32_t middle = expected[33];
    for (const int64_t target : supported_instruction_sets()) {
      force_instruction_set(target);
      SCOPED_TRACE(revisit::instruction_set_name());
      for (const uint32_t limit : {UINT32_MAX, middle, middle + 1, 1u, 0u})
        for (const uint64_t which : {~uint64_t{0}, uint64_t{0}, uint64_t{0x8000'0002'0001'0021}}) {
          uint64_t below = 0;
          for (size_t i = 0; i < 64; ++i) below |= uint64_t{(which >> i & 1) != 0 && expected[i] < limit} << i;
          uint32_t distances[64], shifts[64];
          ASSERT_EQ(revisit_bits_compare(&prepared.query, row.begin(), row.bytes(), which, limit, distances, shifts),
                    below);
          for (size_t i = 0; i < 64; ++i)
            if ((below >> i & 1) != 0) {
              ASSERT_EQ(distances[i], expected[i]);
              ASSERT_EQ(shifts[i], expected_shift[i]);
            }
        }
      EXPECT_EQ(revisit_bits_hamming_at_promising_turn(&prepared.query, row.last()), at_some_turn[63]);
    }
    force_instruction_set(0);
  }
}

// The bound by definition: cells of 20 columns that the query has more, for each of its turns.
int half_bound_by_definition(const Image& query, const Image& place) {
  const uint32_t columns = std::min(query.sectors, uint32_t{REVISIT_BITS_COLUMNS});
  const auto count = [&](const Image& image) {
    std::vector<int> counts(columns);
    for (uint32_t j = 0; j < image.sectors; ++j)
      for (uint32_t i = 0; i < image.rings; ++i)
        counts[j * columns / image.sectors] += image.cells[j * image.rings + i];
    for (int& each : counts) each = std::min(each, 255);
    return counts;
  };
  int least = 255;
  for (uint32_t k = 0; k < query.sectors; ++k) {
    const auto q = count(query.turned(k)), c = count(place);
    int more = 0;
    for (uint32_t g = 0; g < columns; ++g) more += std::max(0, q[g] - c[g]);
    least = std::min(least, more);
  }
  const auto all = [](const Image& image) { return std::count(image.cells.begin(), image.cells.end(), true); };
  const double half = least + std::floor(static_cast<double>(all(place) - all(query)) / 2.0);
  return static_cast<int>(std::clamp(half, 0.0, 255.0));
}

TEST_F(EveryInstructionSet, BoundsAreThoseOfTheDefinitionAndNeverAboveTheDistance) {
  std::mt19937 generator(4);
  for (const auto& [rings, sectors] : {std::pair{60u, 20u}, {20u, 60u}, {3u, 5u}, {64u, 64u}, {7u, 37u}, {65u, 130u}}) {
    constexpr size_t kBlocks = 5, kPlaces = kBlocks * REVISIT_BITS_BLOCK;  // four at once, and one
    const Image query = random_image(rings, sectors, 0.5, generator);
    const Prepared prepared(query);
    struct alignas(64) Line {
      uint8_t bytes[64];
    };
    std::vector<Line> counts(kPlaces / 64 * REVISIT_BITS_COLUMNS);
    std::vector<uint8_t> bounds(kPlaces), least(kBlocks);
    std::vector<uint32_t> occupied(kPlaces);
    std::vector<int> expected(kPlaces);
    for (size_t i = 0; i < kPlaces; ++i) {
      const Image place = i % 3 == 0 ? query.turned(static_cast<uint32_t>(i) % sectors)
                                     : random_image(rings, sectors, 0.003 * static_cast<double>(i), generator);
      Row row(rings, sectors);
      const std::vector<uint8_t> columns = row.add(place);
      occupied[i] = row.begin()->occupied;
      for (size_t region = 0; region < REVISIT_BITS_COLUMNS; ++region)
        counts[i / 64 * REVISIT_BITS_COLUMNS + region].bytes[i % 64] = columns[region];
      expected[i] = half_bound_by_definition(query, place);
      uint32_t shift = 0;
      EXPECT_LE(2 * static_cast<uint32_t>(expected[i]),
                revisit_bits_min_hamming(query.packed().data(), place.packed().data(), rings, sectors, &shift));
    }
    for (const int64_t target : supported_instruction_sets()) {
      force_instruction_set(target);
      revisit_bits_half_bounds(&prepared.query, counts[0].bytes, occupied.data(), kBlocks, bounds.data(), least.data());
      for (size_t i = 0; i < kPlaces; ++i) ASSERT_EQ(bounds[i], expected[i]) << i;
      for (ptrdiff_t block = 0; block < ptrdiff_t{kBlocks}; ++block)
        EXPECT_EQ(least[static_cast<size_t>(block)],
                  *std::min_element(bounds.begin() + 64 * block, bounds.begin() + 64 * block + 64));
      force_instruction_set(0);
    }
  }
}

TEST_F(EveryInstructionSet, BytesBetweenAreThoseOfTheDefinition) {
  std::mt19937 generator(8);
  uint8_t bytes[64];
  for (uint8_t& each : bytes) each = static_cast<uint8_t>(generator());
  bytes[5] = 255, bytes[63] = 0;
  for (const auto& [low, most] : {std::pair<uint8_t, uint8_t>{0, 255}, {0, 0}, {255, 255}, {100, 200}}) {
    uint64_t expected = 0;
    for (size_t i = 0; i < 64; ++i) expected |= uint64_t{bytes[i] >= low && bytes[i] <= most} << i;
    for (const int64_t target : supported_instruction_sets()) {
      force_instruction_set(target);
      EXPECT_EQ(revisit_bits_between(bytes, low, most), expected) << revisit::instruction_set_name();
    }
  }
}

TEST_F(EveryInstructionSet, CommonBitsAreThoseOfTheDefinition) {
  std::mt19937_64 generator(9);
  for (const size_t words : {size_t{0}, size_t{1}, size_t{7}, size_t{8}, size_t{255}}) {
    std::vector<uint64_t> a(words), b(words);
    for (size_t w = 0; w < words; ++w) a[w] = generator(), b[w] = generator();
    uint64_t expected = 0;
    for (size_t bit = 0; bit < 64 * words; ++bit) expected += (a[bit / 64] & b[bit / 64]) >> (bit % 64) & 1;
    for (const int64_t target : supported_instruction_sets()) {
      force_instruction_set(target);
      EXPECT_EQ(revisit_bits_common(a.data(), b.data(), words), expected) << revisit::instruction_set_name();
    }
  }
}

// Counts of the fine regions decide which turns are compared: they must be those of the definition on both sides.
TEST(OccupancyBits, CountsOfRegionsAreThoseOfTheDefinition) {
  std::mt19937 generator(6);
  for (const auto& [rings, sectors] : {std::pair{60u, 20u}, {20u, 60u}, {3u, 5u}, {1u, 1u}, {65u, 130u}}) {
    const Image image = random_image(rings, sectors, 0.6, generator);
    const Prepared prepared(image);
    for (uint32_t k = 0; k < sectors; ++k) {
      const Image turned = image.turned(k);
      Row row(rings, sectors);
      const std::vector<uint8_t> columns = row.add(turned);
      std::vector<uint32_t> fine(REVISIT_BITS_REGIONS), coarse(REVISIT_BITS_COLUMNS);
      for (uint32_t j = 0; j < sectors; ++j)
        for (uint32_t i = 0; i < rings; ++i) {
          const uint32_t cell = turned.cells[j * rings + i];
          fine[2 * (j * std::min(sectors, 20u) / sectors) + (i < (rings + 1) / 2 ? 0 : 1)] += cell;
          coarse[j * std::min(sectors, 20u) / sectors] += cell;
        }
      for (size_t r = 0; r < REVISIT_BITS_REGIONS; ++r) {
        ASSERT_EQ(row.begin()->fine[r], std::min(fine[r], 255u));
        ASSERT_EQ(prepared.query.fine[(r / 8 * ((sectors + 7) / 8 * 8) + k) * 8 + r % 8], row.begin()->fine[r]);
      }
      for (size_t r = 0; r < REVISIT_BITS_COLUMNS; ++r) {
        ASSERT_EQ(columns[r], std::min(coarse[r], 255u));
        ASSERT_EQ(prepared.query.coarse[k * REVISIT_BITS_COLUMNS + r], columns[r]);
      }
    }
  }
}

TEST_F(EveryInstructionSet, SectorProductsAreThoseOfTheDefinition) {
  std::mt19937 generator(7);
  for (const auto& [rings, sectors] : {std::pair{60u, 20u}, {20u, 60u}, {1u, 3u}, {16u, 2u}, {500u, 4u}}) {
    std::vector<uint8_t> q(size_t{rings} * sectors), c(q.size());
    for (size_t i = 0; i < q.size(); ++i) {
      q[i] = static_cast<uint8_t>(generator() % 5 == 0 ? 255 : generator() % 256);
      c[i] = static_cast<uint8_t>(generator() % 5 == 0 ? 255 : generator() % 256);
    }
    const uint32_t shift = 1;
    std::vector<uint32_t> expected(size_t{3} * sectors), sums(expected.size());
    for (size_t j = 0; j < sectors; ++j)
      for (size_t i = 0; i < rings; ++i) {
        const uint32_t a = q[j * rings + i], b = c[(j + shift) % sectors * rings + i];
        expected[3 * j] += a * a;
        expected[3 * j + 1] += b * b;
        expected[3 * j + 2] += a * b;
      }
    for (const int64_t target : supported_instruction_sets()) {
      force_instruction_set(target);
      revisit_bits_sector_products(q.data(), c.data(), rings, sectors, shift, sums.data());
      EXPECT_EQ(sums, expected) << revisit::instruction_set_name();
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
