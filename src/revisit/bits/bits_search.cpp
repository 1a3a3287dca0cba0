// SPDX-License-Identifier: Apache-2.0
// Compiled once for each instruction set by Highway's foreach_target; the best one is chosen at run time.
#include <revisit/bits/occupancy_bits.h>

#include <array>
#include <bit>
#include <cstring>

#ifndef REVISIT_BITS_LANES_OF_BITS  // this file is read once for each instruction set
#define REVISIT_BITS_LANES_OF_BITS
namespace revisit::bits_internal {

// The numbers of the bits that are set, 16 bits each.
struct LanesOfBits {
  uint64_t low = 0, high = 0;
  int count = 0;
};
constexpr auto kLanesOfBits = [] {
  std::array<LanesOfBits, 256> all{};
  for (unsigned bits = 0; bits < 256; ++bits)
    for (unsigned lane = 0; lane < 8; ++lane)
      if ((bits >> lane & 1) != 0) {
        const int at = all[bits].count++;
        (at < 4 ? all[bits].low : all[bits].high) |= uint64_t{lane} << (16 * (at % 4));
      }
  return all;
}();

}  // namespace revisit::bits_internal
#endif

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "revisit/bits/bits_search.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace revisit::bits_internal {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

HWY_INLINE size_t FilledUp(size_t number) { return (number + 7) / 8 * 8; }
HWY_INLINE size_t Stride(const revisit_bits_query& query) {
  return FilledUp((size_t{query.rings} * query.sectors + 63) / 64);
}

// Lanes are places, one byte each: `kVectors` vectors of places are laid on all turns of the query. Of the differences
// of the counts only those where the query has more are summed (docs/retrieval.md).
template <size_t kVectors>
HWY_INLINE void LayPlacesOnTurns(const revisit_bits_query& query, const uint8_t* HWY_RESTRICT counts, size_t place,
                                 uint8_t* HWY_RESTRICT sums) {
  const hn::CappedTag<uint8_t, REVISIT_BITS_BLOCK> d;
  const size_t width = hn::Lanes(d);
  const uint8_t* of_vector[kVectors];
  for (size_t v = 0; v < kVectors; ++v) {
    const size_t at = place + v * width;
    of_vector[v] =
        counts + at / REVISIT_BITS_BLOCK * size_t{REVISIT_BITS_COLUMNS} * REVISIT_BITS_BLOCK + at % REVISIT_BITS_BLOCK;
  }
  auto least_0 = hn::Set(d, uint8_t{255}), least_1 = least_0, least_2 = least_0, least_3 = least_0;
  const uint8_t* HWY_RESTRICT turned = query.coarse;
  for (uint32_t turn = 0; turn < query.sectors; ++turn, turned += REVISIT_BITS_COLUMNS) {
    auto more_0 = hn::Zero(d), more_1 = more_0, more_2 = more_0, more_3 = more_0;
    for (size_t region = 0; region < REVISIT_BITS_COLUMNS; ++region) {
      const auto q = hn::Set(d, turned[region]);
      const auto add = [&](auto& more, size_t v) HWY_ATTR {
        more = hn::SaturatedAdd(more,
                                hn::SaturatedSub(q, hn::Load(d, of_vector[v] + region * size_t{REVISIT_BITS_BLOCK})));
      };
      add(more_0, 0);
      if constexpr (kVectors == 4) add(more_1, 1), add(more_2, 2), add(more_3, 3);
    }
    least_0 = hn::Min(least_0, more_0);
    if constexpr (kVectors == 4) {
      least_1 = hn::Min(least_1, more_1);
      least_2 = hn::Min(least_2, more_2);
      least_3 = hn::Min(least_3, more_3);
    }
  }
  hn::StoreU(least_0, d, sums + place);
  if constexpr (kVectors == 4) {
    hn::StoreU(least_1, d, sums + place + width);
    hn::StoreU(least_2, d, sums + place + 2 * width);
    hn::StoreU(least_3, d, sums + place + 3 * width);
  }
}

void HalfBounds(const revisit_bits_query* query, const uint8_t* HWY_RESTRICT counts,
                const uint32_t* HWY_RESTRICT occupied, size_t blocks, uint8_t* HWY_RESTRICT half_bounds,
                uint8_t* HWY_RESTRICT least_of_blocks) {
  const size_t width = hn::Lanes(hn::CappedTag<uint8_t, REVISIT_BITS_BLOCK>()), places = blocks * REVISIT_BITS_BLOCK;
  size_t place = 0;
  for (; place + 4 * width <= places; place += 4 * width) LayPlacesOnTurns<4>(*query, counts, place, half_bounds);
  for (; place < places; place += width) LayPlacesOnTurns<1>(*query, counts, place, half_bounds);

  const auto of_query = static_cast<int32_t>(query->occupied);
  for (size_t block = 0; block < blocks; ++block) {
    int32_t least = 255;
    for (size_t i = block * REVISIT_BITS_BLOCK; i < (block + 1) * REVISIT_BITS_BLOCK; ++i) {
      int32_t half = half_bounds[i] + ((static_cast<int32_t>(occupied[i]) - of_query) >> 1);
      half = half < 0 ? 0 : half > 255 ? 255 : half;
      half_bounds[i] = static_cast<uint8_t>(half);
      least = half < least ? half : least;
    }
    least_of_blocks[block] = static_cast<uint8_t>(least);
  }
}

// Which of 64 bytes lie in [low, most]: one bit each.
uint64_t Between(const uint8_t* HWY_RESTRICT bytes, uint8_t low, uint8_t most) {
  const hn::CappedTag<uint8_t, REVISIT_BITS_BLOCK> d;
  const size_t width = hn::Lanes(d);
  uint64_t mask = 0;
  for (size_t i = 0; i < REVISIT_BITS_BLOCK; i += width) {
    const auto v = hn::LoadU(d, bytes + i);
    uint8_t bits[8] = {};
    hn::StoreMaskBits(d, hn::Eq(hn::Min(hn::Max(v, hn::Set(d, low)), hn::Set(d, most)), v), bits);
    uint64_t some = 0;
    for (size_t byte = 0; byte < (width + 7) / 8; ++byte) some |= uint64_t{bits[byte]} << (8 * byte);
    mask |= some << i;
  }
  return mask;
}

// Both are filled up with zeros to `stride` words, a multiple of 8.
HWY_INLINE uint64_t Hamming(const uint64_t* HWY_RESTRICT turned, const uint64_t* HWY_RESTRICT image, size_t stride) {
  const hn::CappedTag<uint64_t, 8> d;
  auto sum = hn::Zero(d);
  for (size_t w = 0; w < stride; w += hn::Lanes(d))
    sum = hn::Add(sum, hn::PopulationCount(hn::Xor(hn::Load(d, turned + w), hn::LoadU(d, image + w))));
  return hn::GetLane(hn::SumOfLanes(d, sum));
}

HWY_INLINE const uint64_t* ImageOf(const revisit_bits_place* place) {
  return reinterpret_cast<const uint64_t*>(place + 1);
}

// Lanes are turns, eight bytes each: by how much the counts of a vector of turns exceed those of a place, summed.
HWY_INLINE auto MoreInTurns(const revisit_bits_query& query, const revisit_bits_place& place, size_t turn,
                            size_t turns) {
  const uint8_t* HWY_RESTRICT fine = place.fine;
  const hn::CappedTag<uint64_t, 8> d;
#if HWY_TARGET == HWY_SCALAR  // its vectors hold one byte, or one word
  uint64_t more = 0;
  for (size_t region = 0; region < REVISIT_BITS_REGIONS; ++region) {
    const uint8_t q = query.fine[(region / 8 * turns + turn) * 8 + region % 8];
    more += q > fine[region] ? q - fine[region] : 0;
  }
  return hn::Set(d, more);
#else
  const hn::Repartition<uint8_t, decltype(d)> d8;
  auto more = hn::Zero(d);
  for (size_t group = 0; group < REVISIT_BITS_REGIONS / 8; ++group) {
    uint64_t eight;
    memcpy(&eight, fine + group * 8, 8);
    const auto q = hn::Load(d8, query.fine + (group * turns + turn) * 8);
    more = hn::Add(more, hn::SumsOf8(hn::SaturatedSub(q, hn::BitCast(d8, hn::Set(d, eight)))));
  }
  return more;
#endif
}

uint32_t HammingAtPromisingTurn(const revisit_bits_query* query, const revisit_bits_place* place) {
  const hn::CappedTag<uint64_t, 8> d;
  const size_t stride = Stride(*query), turns = FilledUp(query->sectors);
  auto promising = hn::Set(d, UINT64_MAX);
  auto k = hn::Iota(d, 0);
  for (size_t turn = 0; turn < turns; turn += hn::Lanes(d)) {
    promising = hn::Min(promising, hn::Or(hn::ShiftLeft<32>(MoreInTurns(*query, *place, turn, turns)), k));
    k = hn::Add(k, hn::Set(d, uint64_t{hn::Lanes(d)}));
  }
  const uint64_t turn = hn::GetLane(hn::MinOfLanes(d, promising)) & UINT32_MAX;
  return static_cast<uint32_t>(Hamming(query->images + turn * stride, ImageOf(place), stride));
}

// First the turns whose bound allows them are collected, for all places; then these are compared. Neither loop has a
// branch that depends on the data, which the processor could not foresee.
uint64_t Compare(const revisit_bits_query* query, const revisit_bits_place* places, size_t place_bytes, uint64_t which,
                 uint32_t limit, uint32_t* HWY_RESTRICT distances, uint32_t* HWY_RESTRICT shifts) {
  const hn::CappedTag<uint64_t, 8> d;
  const size_t width = hn::Lanes(d), stride = Stride(*query), turns = FilledUp(query->sectors);
  const auto place = [&](size_t i) {
    return reinterpret_cast<const revisit_bits_place*>(reinterpret_cast<const uint8_t*>(places) + i * place_bytes);
  };
  for (uint64_t rest = which; rest != 0; rest &= rest - 1) {
    const auto* const bytes = reinterpret_cast<const uint8_t*>(place(static_cast<size_t>(std::countr_zero(rest))));
    for (size_t line = 0; line < HWY_MIN(place_bytes, size_t{256}); line += 64) __builtin_prefetch(bytes + line);
  }
  constexpr size_t kRoom = 512;
  uint16_t pairs[kRoom + 8];  // place << 10 | turn
  size_t count = 0;
  uint64_t least[REVISIT_BITS_BLOCK];  // distance << 32 | turn: of equal distances the first turn counts
  memset(least, 255, sizeof least);
  const auto compare_collected = [&]() HWY_ATTR {
    for (size_t i = 0; i < count; ++i) {
      const size_t of = pairs[i] >> 10, turn = pairs[i] & 1023;
      const uint64_t found = Hamming(query->images + turn * stride, ImageOf(place(of)), stride) << 32 | turn;
      least[of] = HWY_MIN(least[of], found);
    }
    count = 0;
  };
  for (uint64_t rest = which; rest != 0; rest &= rest - 1) {
    const auto i = static_cast<size_t>(std::countr_zero(rest));
    const revisit_bits_place& of_i = *place(i);
    // A turn differs in twice what the query has more, and what the place has more altogether.
    const int64_t half = (int64_t{limit} - of_i.occupied + query->occupied + 1) >> 1;
    const auto allowed = hn::Set(d, static_cast<uint64_t>(half < 0 ? 0 : half));
    for (size_t turn = 0; turn < query->sectors; turn += width) {
      if (count > kRoom) compare_collected();
      uint8_t bits = 0;
      hn::StoreMaskBits(d, hn::Lt(MoreInTurns(*query, of_i, turn, turns), allowed), &bits);
      if (query->sectors - turn < width) bits = static_cast<uint8_t>(bits & ((1u << (query->sectors - turn)) - 1));
      // All of the vector's turns at once: what is written beyond those that are allowed does not count.
      const LanesOfBits& lanes = kLanesOfBits[bits];
      const uint64_t first = (i << 10 | turn) * 0x0001'0001'0001'0001u;
      const uint64_t eight[2] = {lanes.low + first, lanes.high + first};
      memcpy(pairs + count, eight, sizeof eight);
      count += static_cast<size_t>(lanes.count);
    }
  }
  compare_collected();
  uint64_t below = 0;
  for (size_t i = 0; i < REVISIT_BITS_BLOCK; ++i) {
    distances[i] = static_cast<uint32_t>(least[i] >> 32);
    shifts[i] = static_cast<uint32_t>(least[i]);
    below |= uint64_t{distances[i] < limit} << i;
  }
  return below;
}

uint64_t Common(const uint64_t* HWY_RESTRICT a, const uint64_t* HWY_RESTRICT b, size_t words) {
  const hn::CappedTag<uint64_t, 8> d;
  const size_t width = hn::Lanes(d);
  auto sum = hn::Zero(d);
  size_t w = 0;
  for (; w + width <= words; w += width)
    sum = hn::Add(sum, hn::PopulationCount(hn::And(hn::LoadU(d, a + w), hn::LoadU(d, b + w))));
  uint64_t count = hn::GetLane(hn::SumOfLanes(d, sum));
  for (; w < words; ++w) count += static_cast<uint64_t>(std::popcount(a[w] & b[w]));
  return count;
}

// Sums of squares and products of bytes, in 32 bits.
void SectorProducts(const uint8_t* query, const uint8_t* candidate, uint32_t rings, uint32_t sectors, uint32_t shift,
                    uint32_t* sums) {
  const hn::CappedTag<int16_t, 16> d16;
  const hn::Rebind<uint8_t, decltype(d16)> d8;
  const hn::RepartitionToWide<decltype(d16)> d32;
  const size_t width = hn::Lanes(d16);
  for (uint32_t j = 0; j < sectors; ++j) {
    const uint32_t other = j + shift < sectors ? j + shift : j + shift - sectors;
    const uint8_t *q = query + size_t{j} * rings, *c = candidate + size_t{other} * rings;
    auto qq = hn::Zero(d32), cc = qq, qc = qq;
    const auto add = [&](auto q8, auto c8) HWY_ATTR {
      const auto q16 = hn::PromoteTo(d16, q8), c16 = hn::PromoteTo(d16, c8);
      auto high = hn::Zero(d32);
      qq = hn::ReorderWidenMulAccumulate(d32, q16, q16, qq, high);
      qq = hn::Add(qq, high);
      high = hn::Zero(d32);
      cc = hn::ReorderWidenMulAccumulate(d32, c16, c16, cc, high);
      cc = hn::Add(cc, high);
      high = hn::Zero(d32);
      qc = hn::ReorderWidenMulAccumulate(d32, q16, c16, qc, high);
      qc = hn::Add(qc, high);
    };
    size_t ring = 0;
    for (; ring + width <= rings; ring += width) add(hn::LoadU(d8, q + ring), hn::LoadU(d8, c + ring));
    sums[0] = static_cast<uint32_t>(hn::GetLane(hn::SumOfLanes(d32, qq)));
    sums[1] = static_cast<uint32_t>(hn::GetLane(hn::SumOfLanes(d32, cc)));
    sums[2] = static_cast<uint32_t>(hn::GetLane(hn::SumOfLanes(d32, qc)));
    for (; ring < rings; ++ring) {
      sums[0] += uint32_t{q[ring]} * q[ring];
      sums[1] += uint32_t{c[ring]} * c[ring];
      sums[2] += uint32_t{q[ring]} * c[ring];
    }
    sums += 3;
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace revisit::bits_internal
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace revisit::bits_internal {

HWY_EXPORT(HalfBounds);
HWY_EXPORT(Between);
HWY_EXPORT(HammingAtPromisingTurn);
HWY_EXPORT(Compare);
HWY_EXPORT(Common);
HWY_EXPORT(SectorProducts);

}  // namespace revisit::bits_internal

using namespace revisit::bits_internal;

void revisit_bits_half_bounds(const revisit_bits_query* query, const uint8_t* coarse, const uint32_t* occupied,
                              size_t blocks, uint8_t* half_bounds, uint8_t* least) {
  HWY_DYNAMIC_DISPATCH(HalfBounds)(query, coarse, occupied, blocks, half_bounds, least);
}

uint64_t revisit_bits_between(const uint8_t bytes[REVISIT_BITS_BLOCK], uint8_t low, uint8_t most) {
  return HWY_DYNAMIC_DISPATCH(Between)(bytes, low, most);
}

uint32_t revisit_bits_hamming_at_promising_turn(const revisit_bits_query* query, const revisit_bits_place* place) {
  return HWY_DYNAMIC_DISPATCH(HammingAtPromisingTurn)(query, place);
}

uint64_t revisit_bits_compare(const revisit_bits_query* query, const revisit_bits_place* places, size_t place_bytes,
                              uint64_t which, uint32_t limit, uint32_t distances[REVISIT_BITS_BLOCK],
                              uint32_t shifts[REVISIT_BITS_BLOCK]) {
  return HWY_DYNAMIC_DISPATCH(Compare)(query, places, place_bytes, which, limit, distances, shifts);
}

uint64_t revisit_bits_common(const uint64_t* a, const uint64_t* b, size_t words) {
  return HWY_DYNAMIC_DISPATCH(Common)(a, b, words);
}

void revisit_bits_sector_products(const uint8_t* query, const uint8_t* candidate, uint32_t rings, uint32_t sectors,
                                  uint32_t shift, uint32_t* sums) {
  HWY_DYNAMIC_DISPATCH(SectorProducts)(query, candidate, rings, sectors, shift, sums);
}
#endif  // HWY_ONCE
