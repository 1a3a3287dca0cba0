// SPDX-License-Identifier: Apache-2.0
#include <revisit/bits/occupancy_bits.h>

#include <bit>

namespace {

// 64 bits of the cyclic string of `cells` bits, from bit `start` on.
inline uint64_t read_cyclic(const uint64_t* words, uint32_t cells, uint32_t start) {
  uint64_t value = 0;
  for (uint32_t filled = 0; filled < 64;) {
    const uint32_t offset = start % 64;
    uint32_t available = 64 - offset;
    if (available > cells - start) available = cells - start;
    value |= (words[start / 64] >> offset) << filled;
    filled += available;
    start += available;
    if (start == cells) start = 0;
    // Bits beyond `available` may have been set from padding or the wrapped end: clear them before the next part.
    if (filled < 64) value &= (uint64_t{1} << filled) - 1;
  }
  return value;
}

uint32_t hamming_at_shift(const uint64_t* query, const uint64_t* candidate, uint32_t cells, uint32_t rotation) {
  const auto words = static_cast<uint32_t>(revisit_bits_words(cells));
  const uint32_t tail = cells % 64;
  // Bit b of the turned query is bit b - rotation of the query.
  uint32_t start = (cells - rotation) % cells;
  uint32_t distance = 0;
  for (uint32_t w = 0; w < words; ++w) {
    uint64_t difference = read_cyclic(query, cells, start) ^ candidate[w];
    if (w + 1 == words && tail != 0) difference &= (uint64_t{1} << tail) - 1;
    distance += static_cast<uint32_t>(std::popcount(difference));
    start = (start + 64) % cells;
  }
  return distance;
}

}  // namespace

size_t revisit_bits_words(uint32_t cells) { return (size_t{cells} + 63) / 64; }

uint32_t revisit_bits_min_hamming(const uint64_t* query, const uint64_t* candidate, uint32_t rings, uint32_t sectors,
                                  uint32_t* best_shift) {
  const uint32_t cells = rings * sectors;
  uint32_t best = UINT32_MAX;
  for (uint32_t k = 0; k < sectors; ++k) {
    const uint32_t distance = hamming_at_shift(query, candidate, cells, k * rings);
    if (distance < best) {
      best = distance;
      *best_shift = k;
    }
  }
  return best;
}
