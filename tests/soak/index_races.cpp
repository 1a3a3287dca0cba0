// SPDX-License-Identifier: Apache-2.0
// A place index of so many places, to which one thread adds while four search it: index_races PLACES SECONDS
// (scripts/index_races.sh runs it under ThreadSanitizer). Each query is one of the places, turned: its own place must
// be the answer, and a search of places that were there at its beginning must see those alone.
#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <thread>
#include <vector>

#include <revisit/core/pose.hpp>
#include <revisit/descriptors/intensity_scan_context.hpp>
#include <revisit/retrieval/place_index.hpp>

namespace {

using namespace revisit;

constexpr int kReaders = 4;
constexpr std::size_t kPoints = 150;

// Number `i`, from a sensor turned by so many sectors.
IntensityScanContext place(std::size_t i, int turn) {
  const DescriptorOptions grid;
  std::mt19937_64 random(i);
  std::uniform_real_distribution<double> share(0.0, 1.0);
  std::vector<Point> points;
  points.reserve(kPoints);
  for (std::size_t k = 0; k < kPoints; ++k) {
    const double range_m = 79.0 * share(random) + 0.5;
    // In the middle of a sector, so that a turn changes nothing but which one it is.
    const int sector = static_cast<int>(random() % static_cast<unsigned>(grid.sectors)) + turn;
    const double azimuth = (sector + 0.5) * 2.0 * kPi / grid.sectors;
    points.push_back({static_cast<float>(range_m * std::cos(azimuth)), static_cast<float>(range_m * std::sin(azimuth)),
                      static_cast<float>(-1.5 + 8.0 * share(random)), static_cast<float>(share(random))});
  }
  return describe(points, grid);
}

struct Counts {
  std::atomic<std::size_t> searches = 0, wrong = 0;
};

void search_until(const std::atomic<bool>& is_over, const PlaceIndex& index, unsigned seed, Counts& counts) {
  std::mt19937_64 random(seed);
  while (!is_over) {
    const std::size_t places = index.size(), wanted = random() % places;
    const auto found = index.search(place(wanted, static_cast<int>(random() % 7)), places);
    const auto kept = index.find(FrameId{static_cast<std::int64_t>(wanted)});
    ++counts.searches;
    if (!found || found->empty() || found->front().match.value != static_cast<std::int64_t>(wanted) || !kept ||
        found->back().match.value >= static_cast<std::int64_t>(places))
      ++counts.wrong;
  }
}

}  // namespace

int main(int argc, char** argv) {
  const std::size_t places = argc > 1 ? std::strtoull(argv[1], nullptr, 10) : 20000;
  const auto seconds = std::chrono::seconds(argc > 2 ? std::atoi(argv[2]) : 5);
  PlaceIndex index{RetrievalOptions()};
  const auto add = [&] {
    const std::size_t i = index.size();
    index.add(FrameId{static_cast<std::int64_t>(i)}, 0.1 * static_cast<double>(i), place(i, 0));
  };
  while (index.size() < places) add();
  std::printf("%zu places; now one thread adds and %d search for %lld s\n", places, kReaders,
              static_cast<long long>(seconds.count()));
  std::fflush(stdout);
  std::atomic<bool> is_over = false;
  Counts counts;
  std::vector<std::thread> readers;
  for (unsigned reader = 0; reader < kReaders; ++reader)
    readers.emplace_back([&, reader] { search_until(is_over, index, reader, counts); });
  const auto end = std::chrono::steady_clock::now() + seconds;
  while (std::chrono::steady_clock::now() < end) add();
  is_over = true;
  for (std::thread& reader : readers) reader.join();
  std::printf("%zu added, %zu searched, %zu answers wrong\n", index.size() - places, counts.searches.load(),
              counts.wrong.load());
  return counts.searches > 0 && counts.wrong == 0 ? 0 : 1;
}
