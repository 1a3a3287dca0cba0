// SPDX-License-Identifier: Apache-2.0
// The readable reference: scalar, by definition. bits_search.cpp holds what is fast.
#include <revisit/bits/occupancy_bits.h>

#include <bit>
#include <cstring>

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

uint32_t filled_up(uint32_t turns) { return (turns + 7) / 8 * 8; }

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

size_t revisit_bits_turned_words(uint32_t rings, uint32_t sectors) {
  return revisit_bits_words(rings * sectors) * filled_up(sectors);
}

void revisit_bits_turn(const uint64_t* query, uint32_t rings, uint32_t sectors, uint64_t* turned) {
  const auto words = static_cast<uint32_t>(revisit_bits_words(rings * sectors));
  const uint32_t lanes = filled_up(sectors);
  // The lanes that fill up repeat the first turn: of equal distances the first counts, so they never win.
  for (uint32_t w = 0; w < words; ++w)
    for (uint32_t lane = 0; lane < lanes; ++lane)
      turned[size_t{w} * lanes + lane] = turned_word(query, rings, sectors, lane < sectors ? lane : 0, w);
}

namespace {

// The bits set in [begin, end).
uint32_t count_bits(const uint64_t* words, uint32_t begin, uint32_t end) {
  uint32_t sum = 0;
  while (begin < end) {
    const uint32_t offset = begin % 64, length = end - begin < 64 - offset ? end - begin : 64 - offset;
    const uint64_t mask = length == 64 ? ~uint64_t{0} : (uint64_t{1} << length) - 1;
    sum += static_cast<uint32_t>(std::popcount(words[begin / 64] >> offset & mask));
    begin += length;
  }
  return sum;
}

// The occupied cells of each column, sector j of the image laid on sector j + shift.
void count_columns(const uint64_t* image, uint32_t rings, uint32_t sectors, uint32_t shift,
                   uint8_t counts[REVISIT_BITS_COLUMNS]) {
  const uint32_t columns = sectors < REVISIT_BITS_COLUMNS ? sectors : REVISIT_BITS_COLUMNS;
  uint32_t sums[REVISIT_BITS_COLUMNS] = {};
  for (uint32_t j = 0; j < sectors; ++j) {
    const uint32_t column = static_cast<uint32_t>(uint64_t{(j + shift) % sectors} * columns / sectors);
    sums[column] += count_bits(image, j * rings, (j + 1) * rings);
  }
  for (int c = 0; c < REVISIT_BITS_COLUMNS; ++c) counts[c] = static_cast<uint8_t>(sums[c] < 255 ? sums[c] : 255);
}

}  // namespace

void revisit_bits_columns(const uint64_t* image, uint32_t rings, uint32_t sectors,
                          uint8_t counts[REVISIT_BITS_COLUMNS]) {
  count_columns(image, rings, sectors, 0, counts);
}

size_t revisit_bits_turned_columns_bytes(uint32_t sectors) {
  return size_t{sectors} * REVISIT_BITS_COLUMNS * REVISIT_BITS_BLOCK;
}

void revisit_bits_turn_columns(const uint64_t* query, uint32_t rings, uint32_t sectors, uint8_t* turned) {
  for (uint32_t shift = 0; shift < sectors; ++shift) {
    uint8_t counts[REVISIT_BITS_COLUMNS];
    count_columns(query, rings, sectors, shift, counts);
    for (const uint8_t count : counts) {
      std::memset(turned, count, REVISIT_BITS_BLOCK);
      turned += REVISIT_BITS_BLOCK;
    }
  }
}
