// SPDX-License-Identifier: Apache-2.0
// Milliseconds a query over ever more places, beside what else is done: comparing every place with the readable
// reference, ring keys in a k-d tree, FAISS (search_others.hpp), all on the same descriptors in the same run.
// Arguments: places, K, threads, and whether the queries are of places in the map (1) or of another town (0).
#include <benchmark/benchmark.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <memory>

#include <revisit/core/stopwatch.hpp>
#include <revisit/descriptors/similarity.hpp>
#include <revisit/io/scan_file.hpp>
#include <revisit/retrieval/internal/nearest_images.hpp>

#include "realistic_places.hpp"
#include "search_others.hpp"

namespace {

using namespace revisit;
using namespace revisit::retrieval_internal;

struct Grid {
  DescriptorOptions options;
  bench::RealisticPlaces places;
  std::unique_ptr<PlaceStore> store = std::make_unique<PlaceStore>();

  explicit Grid(const DescriptorOptions& grid) : options(grid), places(grid) {}
  // Places are added as ever larger maps are measured; a smaller one is the beginning of a larger.
  const PlaceStore& with(std::size_t count) {
    for (std::size_t i = store->size(); i < count; ++i)
      store->add(FrameId{static_cast<std::int64_t>(i)}, 0.1 * static_cast<double>(i), places.place(i));
    return *store;
  }
  const std::vector<IntensityScanContext>& queries(bool in_the_map) const {
    return in_the_map ? places.seen_again() : places.elsewhere();
  }
};

Grid& grid(int rings) {
  static std::map<int, std::unique_ptr<Grid>> grids;
  auto& found = grids[rings];
  if (!found) {
    DescriptorOptions options;
    options.rings = rings;
    options.sectors = 1200 / rings;
    options.levels = 0;
    options.max_range_m = 50.0;
    found = std::make_unique<Grid>(options);
  }
  return *found;
}

// A query in steps of 13 scans, so that they come from everywhere.
const IntensityScanContext& nth(const std::vector<IntensityScanContext>& queries, std::size_t n) {
  return queries[n * 13 % queries.size()];
}

void search(benchmark::State& state, int rings) {
  const auto count = static_cast<std::size_t>(state.range(0)), k = static_cast<std::size_t>(state.range(1));
  Grid& all = grid(rings);
  const PlaceStore& store = all.with(count);
  const auto& queries = all.queries(state.range(3) != 0);
  std::size_t next = 0, searched = 0, compared = 0;
  for (auto _ : state) {
    SearchCounts counts;
    const auto near = nearest_images(store, count, nth(queries, next++).occupancy.data(), k, UINT32_MAX,
                                     static_cast<int>(state.range(2)), &counts);
    benchmark::DoNotOptimize(near->data());
    searched += counts.places;
    compared += counts.compared;
  }
  state.counters["pruned"] = 1.0 - static_cast<double>(compared) / static_cast<double>(searched);
}

void scalar_search(benchmark::State& state, int rings) {
  const auto count = static_cast<std::size_t>(state.range(0));
  Grid& all = grid(rings);
  const PlaceStore& store = all.with(count);
  std::size_t next = 0;
  for (auto _ : state) {
    const IntensityScanContext& query = nth(all.queries(true), next++);
    std::uint32_t least = UINT32_MAX, shift = 0;
    for (std::size_t i = 0; i < count; ++i)
      least = std::min(least, revisit_bits_min_hamming(query.occupancy.data(), PlaceStore::image_of(store.place(i)),
                                                       static_cast<std::uint32_t>(store.rings()),
                                                       static_cast<std::uint32_t>(store.sectors()), &shift));
    benchmark::DoNotOptimize(least);
  }
}

// Another index's search; how often it finds what the exact search finds stands beside its time.
template <typename Other>
void other_search(benchmark::State& state, int rings) {
  const auto count = static_cast<std::size_t>(state.range(0)), k = static_cast<std::size_t>(state.range(1));
  Grid& all = grid(rings);
  const PlaceStore& store = all.with(count);
  Other other(store, count);
  const auto& queries = all.queries(true);
  std::size_t found = 0;
  const std::size_t checked = Other::kIsExact ? 2 : 40;
  for (std::size_t i = 0; i < checked; ++i) {
    const auto exact = nearest_images(store, count, nth(queries, i).occupancy.data(), 1, UINT32_MAX);
    found += other.nearest(nth(queries, i), k) == (*exact)[0].distance;
  }
  std::size_t next = 0;
  for (auto _ : state) benchmark::DoNotOptimize(other.nearest(nth(queries, next++), k));
  state.counters["recall"] = static_cast<double>(found) / static_cast<double>(checked);
}

void ring_keys(benchmark::State& state, int rings) { other_search<bench::RingKeyTree>(state, rings); }
void faiss_search(benchmark::State& state, int rings) { other_search<bench::FaissOfAllShifts>(state, rings); }

// All pairs of one query with 4,541 places; the time is of one pair.
template <typename PairTest>
void pairs(benchmark::State& state, int rings, PairTest test) {
  constexpr std::size_t kPlaces = 4541;
  Grid& all = grid(rings);
  std::vector<bench::ByteImage> places;
  std::vector<IntensityScanContext> contexts;
  for (std::size_t i = 0; i < kPlaces; ++i) {
    contexts.push_back(all.places.place(i));
    places.emplace_back(contexts.back());
  }
  const IntensityScanContext& query = nth(all.queries(true), 3);
  const bench::ByteImage query_bytes(query);
  std::size_t next = 0;
  for (auto _ : state) {
    const std::size_t i = next++ % kPlaces;
    if constexpr (std::is_invocable_v<PairTest, const bench::ByteImage&, const bench::ByteImage&>)
      benchmark::DoNotOptimize(test(query_bytes, places[i]));
    else
      benchmark::DoNotOptimize(test(query, contexts[i]));
  }
}

std::uint32_t scalar_pair(const IntensityScanContext& query, const IntensityScanContext& place) {
  std::uint32_t shift = 0;
  return revisit_bits_min_hamming(query.occupancy.data(), place.occupancy.data(),
                                  static_cast<std::uint32_t>(query.rings), static_cast<std::uint32_t>(query.sectors),
                                  &shift);
}

double intensity_pair(const IntensityScanContext& query, const IntensityScanContext& place) {
  return match_intensity(query, place, 7);
}

// Blocks of 64 pairs, no limit known, so that every place's distance is found.
void packed_pair(benchmark::State& state, int rings) {
  constexpr std::size_t kBlocks = 4541 / 64;
  Grid& all = grid(rings);
  const PlaceStore& store = all.with(4541);
  const auto r = static_cast<std::uint32_t>(store.rings()), s = static_cast<std::uint32_t>(store.sectors());
  AlignedVector<std::uint8_t> memory(revisit_bits_query_bytes(r, s));
  revisit_bits_query query;
  revisit_bits_prepare(nth(all.queries(true), 3).occupancy.data(), r, s, memory.data(), &query);
  std::size_t next = 0;
  std::uint32_t distances[64], shifts[64];
  for (auto _ : state)
    benchmark::DoNotOptimize(revisit_bits_compare(&query, store.place(next++ % kBlocks * 64), store.place_bytes(),
                                                  ~std::uint64_t{0}, UINT32_MAX, distances, shifts));
  state.counters["ns_a_pair"] = benchmark::Counter(static_cast<double>(state.iterations()) * 64,
                                                   benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
}

// Saving and opening; the first search of an opened index checks what it reads.
void open_saved(benchmark::State& state) {
  const auto count = static_cast<std::size_t>(state.range(0));
  Grid& all = grid(60);
  const std::string path = "out/bench/opened.places";
  if (const Status status = all.with(count).save(path); !status)
    return state.SkipWithError(status.error().message.c_str());
  double first_search_ms = 0.0;
  for (auto _ : state) {
    auto opened = PlaceStore::open(path);
    if (!opened) return state.SkipWithError(opened.error().message.c_str());
    state.PauseTiming();
    Stopwatch watch;
    benchmark::DoNotOptimize(
        nearest_images(**opened, count, nth(all.queries(true), 3).occupancy.data(), 10, UINT32_MAX));
    first_search_ms = watch.lap_ms();
    opened->reset();
    state.ResumeTiming();
  }
  state.counters["first_search_ms"] = first_search_ms;
  state.counters["bytes_a_place"] = static_cast<double>(std::filesystem::file_size(path)) / static_cast<double>(count);
  std::filesystem::remove(path);
}

// How far places are from each other: of the drives, of the made-up streets, of real scans of two towns. `k1`, `k10`:
// medians of the distance to the nearest and to the tenth nearest of 4,000 others, 50 scans around left out.
void distances(benchmark::State& state, int rings, char kind) {
  Grid& all = grid(rings);
  std::vector<IntensityScanContext> set, other;
  if (kind == 'r') {
    const auto read = [&](const char* folder, std::vector<IntensityScanContext>& into) {
      std::vector<std::filesystem::path> files;
      if (std::filesystem::exists(folder))
        for (const auto& entry : std::filesystem::directory_iterator(folder)) files.push_back(entry.path());
      for (const auto& file : files) {
        auto scan = read_scan(file.string());
        if (!scan) continue;
        filter_range(*scan, PreprocessOptions{});
        into.push_back(describe(scan->points, all.options));
      }
    };
    read("../shared/data/kitti00_mini/velodyne", set);
    read("../shared/data/kitti_raw_0005/velodyne_points/data", other);
    if (set.empty() || other.empty()) return state.SkipWithError("no real scans at hand");
  } else {
    const std::size_t first = kind == 'd' ? 0 : 100000;
    for (std::size_t i = 0; i < 4000; ++i) set.push_back(all.places.place(first + i));
  }
  std::vector<std::uint32_t> pairs, nearest, tenth;
  for (auto _ : state)
    for (std::size_t q = 0; q < set.size(); q += std::max<std::size_t>(1, set.size() / 40)) {
      std::vector<std::uint32_t> found;
      for (std::size_t i = 0; i < (other.empty() ? set.size() : other.size()); ++i)
        if (!other.empty() || i + 50 < q || i > q + 50)
          found.push_back(scalar_pair(set[q], other.empty() ? set[i] : other[i]));
      std::sort(found.begin(), found.end());
      nearest.push_back(found[0]);
      tenth.push_back(found[9]);
      pairs.insert(pairs.end(), found.begin(), found.end());
    }
  const auto quantile = [](std::vector<std::uint32_t>& of, double share) {
    const auto at = of.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(of.size() - 1));
    std::nth_element(of.begin(), at, of.end());
    return static_cast<double>(*at);
  };
  state.counters["p01"] = quantile(pairs, 0.01);
  state.counters["p10"] = quantile(pairs, 0.10);
  state.counters["p50"] = quantile(pairs, 0.50);
  state.counters["p90"] = quantile(pairs, 0.90);
  state.counters["k1"] = quantile(nearest, 0.5);
  state.counters["k10"] = quantile(tenth, 0.5);
}

}  // namespace

#define BOTH_GRIDS(function, ...)                                    \
  BENCHMARK_CAPTURE(function, 60x20, 60 __VA_OPT__(, ) __VA_ARGS__); \
  BENCHMARK_CAPTURE(function, 20x60, 20 __VA_OPT__(, ) __VA_ARGS__)
BOTH_GRIDS(packed_pair);
BENCHMARK_CAPTURE(pairs, scalar_60x20, 60, scalar_pair);
BENCHMARK_CAPTURE(pairs, scalar_20x60, 20, scalar_pair);
BENCHMARK_CAPTURE(pairs, bytes_60x20, 60, bench::byte_pair);
BENCHMARK_CAPTURE(pairs, bytes_20x60, 20, bench::byte_pair);
BENCHMARK_CAPTURE(pairs, intensity_60x20, 60, intensity_pair);
BENCHMARK_CAPTURE(pairs, intensity_20x60, 20, intensity_pair);
BENCHMARK_CAPTURE(distances, drives_60x20, 60, 'd')->Iterations(1)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(distances, made_60x20, 60, 'm')->Iterations(1)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(distances, real_60x20, 60, 'r')->Iterations(1)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(distances, drives_20x60, 20, 'd')->Iterations(1)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(distances, made_20x60, 20, 'm')->Iterations(1)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(distances, real_20x60, 20, 'r')->Iterations(1)->Unit(benchmark::kMillisecond);
#define SEARCHES(rings, name)                                                                                \
  BENCHMARK_CAPTURE(search, name, rings)                                                                     \
      ->ArgsProduct({{4541, 18235, 100000, 1000000}, {1, 10, 25}, {1, 2}, {1, 0}})                           \
      ->UseRealTime()                                                                                        \
      ->Unit(benchmark::kMillisecond);                                                                       \
  BENCHMARK_CAPTURE(scalar_search, name, rings)->Args({4541})->Args({18235})->Unit(benchmark::kMillisecond); \
  BENCHMARK_CAPTURE(ring_keys, name, rings)                                                                  \
      ->ArgsProduct({{4541, 18235, 100000, 1000000}, {10, 25}})                                              \
      ->Unit(benchmark::kMillisecond);                                                                       \
  BENCHMARK_CAPTURE(faiss_search, name, rings)                                                               \
      ->ArgsProduct({{4541, 18235, 100000, 1000000}, {1, 10, 25}})                                           \
      ->Unit(benchmark::kMillisecond)
SEARCHES(60, 60x20);
SEARCHES(20, 20x60);
BENCHMARK(open_saved)->Arg(1000000)->Unit(benchmark::kMillisecond)->UseRealTime();

BENCHMARK_MAIN();
