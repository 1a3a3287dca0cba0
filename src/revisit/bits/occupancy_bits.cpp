// SPDX-License-Identifier: Apache-2.0
// The readable reference: scalar, by definition. bits_search.cpp holds what is fast.
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

// Word `w` of the query turned by `shift` sectors: its bit b is bit b - shift * rings of the query.
uint64_t turned_word(const uint64_t* query, uint32_t rings, uint32_t sectors, uint32_t shift, uint32_t w) {
  const uint32_t cells = rings * sectors, tail = cells % 64;
  const uint64_t value = read_cyclic(query, cells, (cells - shift * rings + 64 * w) % cells);
  const bool is_last = w + 1 == revisit_bits_words(cells);
  return is_last && tail != 0 ? value & ((uint64_t{1} << tail) - 1) : value;
}

}  // namespace

size_t revisit_bits_words(uint32_t cells) { return (size_t{cells} + 63) / 64; }

uint32_t revisit_bits_min_hamming(const uint64_t* query, const uint64_t* candidate, uint32_t rings, uint32_t sectors,
                                  uint32_t* best_shift) {
  const auto words = static_cast<uint32_t>(revisit_bits_words(rings * sectors));
  uint32_t best = UINT32_MAX;
  for (uint32_t k = 0; k < sectors; ++k) {
    uint32_t distance = 0;
    for (uint32_t w = 0; w < words; ++w)
      distance += static_cast<uint32_t>(std::popcount(turned_word(query, rings, sectors, k, w) ^ candidate[w]));
    if (distance < best) {
      best = distance;
      *best_shift = k;
    }
  }
  return best;
}
