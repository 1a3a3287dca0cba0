// SPDX-License-Identifier: Apache-2.0
// Counts of occupied cells, and everything about a query that is computed once and laid on many places.
#include <revisit/bits/occupancy_bits.h>

#include <bit>
#include <cstring>

namespace {

constexpr uint32_t kColumns = REVISIT_BITS_COLUMNS;
constexpr uint32_t kGroups = REVISIT_BITS_REGIONS / kColumns;
static_assert(REVISIT_BITS_REGIONS == kGroups * kColumns && REVISIT_BITS_REGIONS % 8 == 0);

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

uint8_t cut(uint32_t count) { return static_cast<uint8_t>(count < 255 ? count : 255); }

// The first ring of each group of rings; groups grow by one ring where the rings cannot be shared out evenly.
uint32_t first_ring(uint32_t group, uint32_t rings) { return (group * rings + kGroups - 1) / kGroups; }

// Occupied cells of sectors [0, j), by groups of rings, going twice around the image.
struct Sums {
  uint32_t of[kGroups];
};
void sum_sectors(const uint64_t* image, uint32_t rings, uint32_t sectors, Sums* sums) {
  sums[0] = {};
  for (uint32_t j = 0; j < sectors; ++j)
    for (uint32_t g = 0; g < kGroups; ++g)
      sums[j + 1].of[g] =
          sums[j].of[g] + count_bits(image, j * rings + first_ring(g, rings), j * rings + first_ring(g + 1, rings));
  for (uint32_t j = 0; j < sectors; ++j)
    for (uint32_t g = 0; g < kGroups; ++g) sums[sectors + j + 1].of[g] = sums[sectors].of[g] + sums[j + 1].of[g];
}

// The counts with sector j of the image laid on sector j + shift.
void count_regions(const Sums* sums, uint32_t sectors, uint32_t shift, uint8_t* coarse, uint8_t* fine) {
  const uint32_t columns = sectors < kColumns ? sectors : kColumns;
  std::memset(coarse, 0, REVISIT_BITS_COLUMNS);
  std::memset(fine, 0, REVISIT_BITS_REGIONS);
  for (uint32_t column = 0, begin = 0; column < columns; ++column) {
    const auto end = static_cast<uint32_t>((uint64_t{column + 1} * sectors + columns - 1) / columns);
    const Sums* const low = sums + (begin >= shift ? begin - shift : begin + sectors - shift);
    const Sums* const high = low + (end - begin);
    uint32_t all = 0;
    for (uint32_t g = 0; g < kGroups; ++g) {
      const uint32_t count = high->of[g] - low->of[g];
      fine[kGroups * column + g] = cut(count);
      all += count;
    }
    coarse[column] = cut(all);
    begin = end;
  }
}

size_t filled_up(size_t number) { return (number + 7) / 8 * 8; }

// Where the parts of a prepared query lie in its memory.
struct Layout {
  size_t words, stride, images, coarse, fine, scratch, end;
  Layout(uint32_t rings, uint32_t sectors) {
    const auto lines = [](size_t bytes) { return (bytes + 63) / 64 * 64; };
    words = revisit_bits_words(rings * sectors);
    stride = filled_up(words);
    images = 0;
    coarse = images + sectors * stride * sizeof(uint64_t);
    fine = coarse + lines(size_t{sectors} * REVISIT_BITS_COLUMNS);
    scratch = fine + filled_up(sectors) * REVISIT_BITS_REGIONS;
    // Sums while counting, the image twice in a row while turning.
    const size_t sums = (size_t{2} * sectors + 1) * sizeof(Sums), twice = (2 * words + 2) * sizeof(uint64_t);
    end = scratch + lines(sums > twice ? sums : twice);
  }
};

void turn_images(const uint64_t* image, uint32_t cells, uint32_t rings, uint32_t sectors, const Layout& layout,
                 uint64_t* twice, uint64_t* turned) {
  // The string of bits twice in a row: every rotation is a part of it.
  std::memset(twice, 0, (2 * layout.words + 2) * sizeof(uint64_t));
  std::memcpy(twice, image, layout.words * sizeof(uint64_t));
  const size_t at = cells / 64;
  const uint32_t by = cells % 64;
  for (size_t w = 0; w < layout.words; ++w) {
    twice[at + w] |= image[w] << by;
    if (by != 0) twice[at + w + 1] |= image[w] >> (64 - by);
  }
  const uint64_t tail = cells % 64 == 0 ? ~uint64_t{0} : (uint64_t{1} << (cells % 64)) - 1;
  for (uint32_t turn = 0; turn < sectors; ++turn, turned += layout.stride) {
    const uint32_t start = cells - turn * rings, offset = start % 64;
    const uint64_t* from = twice + start / 64;
    for (size_t w = 0; w < layout.words; ++w)
      turned[w] = offset == 0 ? from[w] : from[w] >> offset | from[w + 1] << (64 - offset);
    turned[layout.words - 1] &= tail;
    for (size_t w = layout.words; w < layout.stride; ++w) turned[w] = 0;
  }
}

}  // namespace

size_t revisit_bits_place_bytes(uint32_t rings, uint32_t sectors) {
  return sizeof(revisit_bits_place) + filled_up(revisit_bits_words(rings * sectors)) * sizeof(uint64_t);
}

void revisit_bits_make_place(const uint64_t* image, uint32_t rings, uint32_t sectors, revisit_bits_place* place,
                             uint8_t columns[REVISIT_BITS_COLUMNS]) {
  uint32_t counts[REVISIT_BITS_REGIONS] = {};
  const uint32_t used = sectors < kColumns ? sectors : kColumns;
  for (uint32_t j = 0; j < sectors; ++j) {
    const auto column = static_cast<uint32_t>(uint64_t{j} * used / sectors);
    for (uint32_t g = 0; g < kGroups; ++g)
      counts[column * kGroups + g] +=
          count_bits(image, j * rings + first_ring(g, rings), j * rings + first_ring(g + 1, rings));
  }
  std::memset(place, 0, revisit_bits_place_bytes(rings, sectors));
  place->occupied = count_bits(image, 0, rings * sectors);
  for (size_t column = 0; column < kColumns; ++column) {
    uint32_t all = 0;
    for (size_t g = 0; g < kGroups; ++g) {
      place->fine[column * kGroups + g] = cut(counts[column * kGroups + g]);
      all += counts[column * kGroups + g];
    }
    columns[column] = cut(all);
  }
  std::memcpy(place + 1, image, revisit_bits_words(rings * sectors) * sizeof(uint64_t));
}

size_t revisit_bits_query_bytes(uint32_t rings, uint32_t sectors) { return Layout(rings, sectors).end; }

void revisit_bits_prepare(const uint64_t* image, uint32_t rings, uint32_t sectors, void* memory,
                          revisit_bits_query* query) {
  const Layout layout(rings, sectors);
  auto* const bytes = static_cast<uint8_t*>(memory);
  auto* const images = reinterpret_cast<uint64_t*>(bytes + layout.images);
  uint8_t *const coarse = bytes + layout.coarse, *const fine = bytes + layout.fine;
  turn_images(image, rings * sectors, rings, sectors, layout, reinterpret_cast<uint64_t*>(bytes + layout.scratch),
              images);

  auto* const sums = reinterpret_cast<Sums*>(bytes + layout.scratch);
  sum_sectors(image, rings, sectors, sums);
  std::memset(fine, 255, layout.scratch - layout.fine);  // turns that fill up exceed any place
  for (uint32_t turn = 0; turn < sectors; ++turn) {
    uint8_t regions[REVISIT_BITS_REGIONS];
    count_regions(sums, sectors, turn, coarse + size_t{turn} * REVISIT_BITS_COLUMNS, regions);
    for (size_t group = 0; group < REVISIT_BITS_REGIONS / 8; ++group)
      std::memcpy(fine + (group * filled_up(sectors) + turn) * 8, regions + group * 8, 8);
  }
  *query = {rings, sectors, count_bits(image, 0, rings * sectors), images, coarse, fine};
}
