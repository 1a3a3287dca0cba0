// SPDX-License-Identifier: Apache-2.0
// Milliseconds a query over ever more places, and nanoseconds a pair beside two references in the same run: the
// readable scalar one, and the pair test of byte cells as the published program does it (one byte a cell, every shift,
// cell by cell; written from its description). Google Benchmark's arguments: places, K, threads.
#include <benchmark/benchmark.h>

#include <map>
#include <memory>

#include <revisit/retrieval/internal/nearest_images.hpp>

#include "realistic_places.hpp"

namespace {

using namespace revisit;
using namespace revisit::retrieval_internal;

struct Grid {
  bench::RealisticPlaces places;
  std::unique_ptr<PlaceStore> store;

  explicit Grid(const DescriptorOptions& options) : places(options) {}
  // Places are added as ever larger maps are asked for; a smaller one is the beginning of a larger.
  const PlaceStore& with(std::size_t count) {
    if (!store) store = std::make_unique<PlaceStore>();
    for (std::size_t i = store->size(); i < count; ++i)
      store->add(FrameId{static_cast<std::int64_t>(i)}, 0.1 * static_cast<double>(i), places.place(i));
    return *store;
  }
};

Grid& grid(int rings) {
  static std::map<int, std::unique_ptr<Grid>> grids;
  auto& found = grids[rings];
  if (!found) {
    DescriptorOptions options;
    options.rings = rings;
    options.sectors = 1200 / rings;
    found = std::make_unique<Grid>(options);
  }
  return *found;
}

void search(benchmark::State& state, int rings) {
  const auto count = static_cast<std::size_t>(state.range(0)), k = static_cast<std::size_t>(state.range(1));
  Grid& all = grid(rings);
  const PlaceStore& store = all.with(count);
  std::vector<IntensityScanContext> queries;
  for (std::size_t i = 0; i < 64; ++i) queries.push_back(all.places.query(i));
  std::size_t next = 0, searched = 0, compared = 0;
  for (auto _ : state) {
    SearchCounts counts;
    const auto near = nearest_images(store, count, queries[next++ % queries.size()].occupancy.data(), k, UINT32_MAX,
                                     static_cast<int>(state.range(2)), &counts);
    benchmark::DoNotOptimize(near.data());
    searched += counts.places;
    compared += counts.compared;
  }
  state.counters["pruned"] = 1.0 - static_cast<double>(compared) / static_cast<double>(searched);
}

// All pairs of one query with 4,541 places; the time is of one pair.
template <typename PairTest>
void pairs(benchmark::State& state, int rings, PairTest test) {
  constexpr std::size_t kPlaces = 4541;
  Grid& all = grid(rings);
  all.with(kPlaces);
  std::vector<IntensityScanContext> places;
  for (std::size_t i = 0; i < kPlaces; ++i) places.push_back(all.places.place(i));
  const IntensityScanContext query = all.places.query(3);
  std::size_t next = 0;
  for (auto _ : state) benchmark::DoNotOptimize(test(query, places[next++ % kPlaces]));
}

std::uint32_t scalar_pair(const IntensityScanContext& query, const IntensityScanContext& place) {
  std::uint32_t shift = 0;
  return revisit_bits_min_hamming(query.occupancy.data(), place.occupancy.data(),
                                  static_cast<std::uint32_t>(query.rings), static_cast<std::uint32_t>(query.sectors),
                                  &shift);
}

std::size_t cell(const IntensityScanContext& of, int sector, int ring) {
  return static_cast<std::size_t>(sector) * static_cast<std::size_t>(of.rings) + static_cast<std::size_t>(ring);
}

std::uint32_t byte_pair(const IntensityScanContext& query, const IntensityScanContext& place) {
  std::uint32_t best = UINT32_MAX;
  for (int shift = 0; shift < query.sectors; ++shift) {
    std::uint32_t differing = 0;
    for (int sector = 0; sector < query.sectors; ++sector) {
      const int other = sector + shift < query.sectors ? sector + shift : sector + shift - query.sectors;
      for (int ring = 0; ring < query.rings; ++ring) {
        const bool q = query.intensity[cell(query, sector, ring)] > 0;
        const bool c = place.intensity[cell(place, other, ring)] > 0;
        differing += q != c;
      }
    }
    best = std::min(best, differing);
  }
  return best;
}

void packed_pair(benchmark::State& state, int rings) {
  constexpr std::size_t kPlaces = 4541;
  Grid& all = grid(rings);
  const PlaceStore& store = all.with(kPlaces);
  const auto r = static_cast<std::uint32_t>(store.rings()), s = static_cast<std::uint32_t>(store.sectors());
  AlignedVector<std::uint64_t> turned(revisit_bits_turned_words(r, s));
  revisit_bits_turn(all.places.query(3).occupancy.data(), r, s, turned.data());
  std::size_t next = 0;
  for (auto _ : state) {
    std::uint32_t shift = 0;
    benchmark::DoNotOptimize(
        revisit_bits_min_hamming_turned(turned.data(), store.image(next++ % kPlaces), r, s, UINT32_MAX, &shift));
  }
}

}  // namespace

BENCHMARK_CAPTURE(packed_pair, 60x20, 60);
BENCHMARK_CAPTURE(packed_pair, 20x60, 20);
BENCHMARK_CAPTURE(pairs, scalar_60x20, 60, scalar_pair);
BENCHMARK_CAPTURE(pairs, scalar_20x60, 20, scalar_pair);
BENCHMARK_CAPTURE(pairs, bytes_60x20, 60, byte_pair);
BENCHMARK_CAPTURE(pairs, bytes_20x60, 20, byte_pair);
BENCHMARK_CAPTURE(search, 60x20, 60)
    ->ArgsProduct({{4541, 18235, 100000, 1000000}, {1, 10, 25}, {1, 2}})
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(search, 20x60, 20)
    ->ArgsProduct({{4541, 18235, 100000, 1000000}, {1, 10, 25}, {1, 2}})
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);

BENCHMARK_MAIN();
