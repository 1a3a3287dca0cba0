// SPDX-License-Identifier: Apache-2.0
// Compiled once for each instruction set by Highway's foreach_target; the best one is chosen at run time.
#include <revisit/bits/occupancy_bits.h>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "revisit/bits/bits_search.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace revisit::bits_internal {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

struct Best {
  uint32_t distance, shift;
};

// Lanes are turns: a word of the candidate is laid on that word of many turns at once, and nothing is summed across
// lanes. `kVectors` vectors of turns from lane `first` on; betters `best`, or gives up.
template <int kVectors>
HWY_INLINE void LayOnTurns(const uint64_t* HWY_RESTRICT turned, const uint64_t* HWY_RESTRICT candidate, size_t words,
                           size_t lanes, size_t first, Best& best) {
  const hn::CappedTag<uint64_t, 8> d;
  const size_t width = hn::Lanes(d);
  constexpr size_t kWordsBetweenLooks = 6;
  const auto limit = hn::Set(d, uint64_t{best.distance});
  const auto differing = [&](size_t w, size_t v) HWY_ATTR {
    return hn::PopulationCount(hn::Xor(hn::Set(d, candidate[w]), hn::LoadU(d, turned + w * lanes + first + v * width)));
  };
  auto a = hn::Zero(d), b = a, c = a, e = a;
  for (size_t w = 0; w < words;) {
    for (const size_t stop = HWY_MIN(words, w + kWordsBetweenLooks); w < stop; ++w) {
      a = hn::Add(a, differing(w, 0));
      if constexpr (kVectors > 1) b = hn::Add(b, differing(w, 1));
      if constexpr (kVectors > 2) c = hn::Add(c, differing(w, 2));
      if constexpr (kVectors > 3) e = hn::Add(e, differing(w, 3));
    }
    auto least = a;
    if constexpr (kVectors > 1) least = hn::Min(least, b);
    if constexpr (kVectors > 2) least = hn::Min(least, c);
    if constexpr (kVectors > 3) least = hn::Min(least, e);
    if (hn::AllFalse(d, hn::Lt(least, limit))) return;
  }
  auto least = a;
  if constexpr (kVectors > 1) least = hn::Min(least, b);
  if constexpr (kVectors > 2) least = hn::Min(least, c);
  if constexpr (kVectors > 3) least = hn::Min(least, e);
  const uint64_t distance = hn::GetLane(hn::MinOfLanes(d, least));
  if (distance >= best.distance) return;
  // The first turn that reaches it.
  const auto wanted = hn::Set(d, distance);
  intptr_t lane = hn::FindFirstTrue(d, hn::Eq(a, wanted));
  const auto look_on = [&](decltype(a) sums, size_t vector) HWY_ATTR {
    if (lane >= 0) return;
    lane = hn::FindFirstTrue(d, hn::Eq(sums, wanted));
    if (lane >= 0) lane += static_cast<intptr_t>(vector * width);
  };
  if constexpr (kVectors > 1) look_on(b, 1);
  if constexpr (kVectors > 2) look_on(c, 2);
  if constexpr (kVectors > 3) look_on(e, 3);
  best = {static_cast<uint32_t>(distance), static_cast<uint32_t>(first + static_cast<size_t>(lane))};
}

uint32_t MinHamming(const uint64_t* turned, const uint64_t* candidate, uint32_t rings, uint32_t sectors, uint32_t limit,
                    uint32_t* best_shift) {
  const size_t words = revisit_bits_words(rings * sectors), lanes = (size_t{sectors} + 7) / 8 * 8;
  const size_t width = hn::Lanes(hn::CappedTag<uint64_t, 8>());
  Best best{limit, UINT32_MAX};
  for (size_t first = 0; first < lanes;) {
    const size_t vectors = HWY_MIN(size_t{4}, (lanes - first) / width);
    switch (vectors) {
      case 1:
        LayOnTurns<1>(turned, candidate, words, lanes, first, best);
        break;
      case 2:
        LayOnTurns<2>(turned, candidate, words, lanes, first, best);
        break;
      case 3:
        LayOnTurns<3>(turned, candidate, words, lanes, first, best);
        break;
      default:
        LayOnTurns<4>(turned, candidate, words, lanes, first, best);
        break;
    }
    first += vectors * width;
  }
  if (best.shift == UINT32_MAX) return UINT32_MAX;
  *best_shift = best.shift;
  return best.distance;
}

// Lanes are places, one byte each: a vector of places is laid on all turns of the query.
void Bounds(const uint8_t* HWY_RESTRICT turned, uint32_t sectors, const uint8_t* HWY_RESTRICT counts, size_t blocks,
            uint8_t* HWY_RESTRICT bounds) {
  const hn::CappedTag<uint8_t, REVISIT_BITS_BLOCK> d;
  const size_t width = hn::Lanes(d);
  for (size_t block = 0; block < blocks; ++block) {
    for (size_t place = 0; place < REVISIT_BITS_BLOCK; place += width) {
      auto least = hn::Set(d, uint8_t{255});
      const uint8_t* HWY_RESTRICT query = turned;
      for (uint32_t turn = 0; turn < sectors; ++turn) {
        auto sum = hn::Zero(d);
        for (size_t column = 0; column < REVISIT_BITS_COLUMNS; ++column) {  // unrolled: the place stays in registers
          const auto q = hn::LoadU(d, query + column * REVISIT_BITS_BLOCK);
          const auto c = hn::LoadU(d, counts + column * REVISIT_BITS_BLOCK + place);
          sum = hn::SaturatedAdd(sum, hn::Sub(hn::Max(q, c), hn::Min(q, c)));
        }
        least = hn::Min(least, sum);
        query += size_t{REVISIT_BITS_COLUMNS} * REVISIT_BITS_BLOCK;
      }
      hn::StoreU(least, d, bounds + place);
    }
    counts += size_t{REVISIT_BITS_COLUMNS} * REVISIT_BITS_BLOCK;
    bounds += REVISIT_BITS_BLOCK;
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace revisit::bits_internal
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace revisit::bits_internal {

HWY_EXPORT(MinHamming);
HWY_EXPORT(Bounds);

}  // namespace revisit::bits_internal

using namespace revisit::bits_internal;

uint32_t revisit_bits_min_hamming_turned(const uint64_t* turned, const uint64_t* candidate, uint32_t rings,
                                         uint32_t sectors, uint32_t limit, uint32_t* best_shift) {
  return HWY_DYNAMIC_DISPATCH(MinHamming)(turned, candidate, rings, sectors, limit, best_shift);
}

void revisit_bits_bounds(const uint8_t* turned, uint32_t sectors, const uint8_t* counts, size_t blocks,
                         uint8_t* bounds) {
  HWY_DYNAMIC_DISPATCH(Bounds)(turned, sectors, counts, blocks, bounds);
}
#endif  // HWY_ONCE
