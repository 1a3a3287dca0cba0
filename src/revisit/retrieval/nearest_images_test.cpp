// SPDX-License-Identifier: Apache-2.0
// Bounds, order and threads never change an answer: the search against comparing every place with the readable
// reference.
#include <revisit/retrieval/internal/nearest_images.hpp>

#include <algorithm>
#include <random>
#include <thread>

#include <gtest/gtest.h>

namespace revisit::retrieval_internal {
namespace {

struct Grid {
  int rings, sectors;
};

class Places {
 public:
  Places(const Grid& grid, unsigned seed) : grid_(grid), random_(seed) {}

  IntensityScanContext even(double density) {
    IntensityScanContext context = empty();
    for (std::size_t i = 0; i < context.cells(); ++i)
      if (uniform() < density) set(context, i);
    return context;
  }
  // Denser near the sensor and in some sectors, as scans are.
  IntensityScanContext as_scans_are() {
    IntensityScanContext context = empty();
    for (int sector = 0; sector < grid_.sectors; ++sector) {
      const double reach = uniform() * grid_.rings;
      for (int ring = 0; ring < grid_.rings; ++ring)
        if (uniform() < (ring < reach ? 0.95 : 0.08)) set(context, cell(sector, ring));
    }
    return context;
  }
  // The same place again: turned, and some cells changed.
  IntensityScanContext again(const IntensityScanContext& place, double changed) {
    IntensityScanContext context = empty();
    const int shift = static_cast<int>(uniform() * grid_.sectors);
    for (int sector = 0; sector < grid_.sectors; ++sector)
      for (int ring = 0; ring < grid_.rings; ++ring)
        if (place.occupied(ring, sector) != (uniform() < changed))
          set(context, cell((sector + shift) % grid_.sectors, ring));
    return context;
  }

 private:
  double uniform() { return std::uniform_real_distribution<double>()(random_); }
  std::size_t cell(int sector, int ring) const {
    return static_cast<std::size_t>(sector) * static_cast<std::size_t>(grid_.rings) + static_cast<std::size_t>(ring);
  }
  IntensityScanContext empty() const {
    IntensityScanContext context;
    context.rings = grid_.rings;
    context.sectors = grid_.sectors;
    context.intensity.resize(cell(grid_.sectors, 0));
    context.occupancy.resize(revisit_bits_words(static_cast<std::uint32_t>(context.cells())));
    return context;
  }
  static void set(IntensityScanContext& context, std::size_t i) {
    context.intensity[i] = 100;
    context.occupancy[i / 64] |= std::uint64_t{1} << (i % 64);
  }

  Grid grid_;
  std::mt19937 random_;
};

// The distance to every place, by the readable reference.
std::vector<NearImage> compare_all(const PlaceStore& store, const IntensityScanContext& query) {
  std::vector<NearImage> all(store.size());
  for (std::size_t i = 0; i < all.size(); ++i) {
    all[i].place = i;
    all[i].distance = revisit_bits_min_hamming(query.occupancy.data(), PlaceStore::image_of(store.place(i)),
                                               static_cast<std::uint32_t>(query.rings),
                                               static_cast<std::uint32_t>(query.sectors), &all[i].shift);
  }
  return all;
}

std::vector<NearImage> nearest_of(std::vector<NearImage> all, PlaceRange among, std::size_t count,
                                  std::uint32_t farthest) {
  std::erase_if(all, [&](const NearImage& each) { return each.place < among.first || each.place >= among.last; });
  std::erase_if(all, [&](const NearImage& each) { return each.distance > farthest; });
  std::sort(all.begin(), all.end());
  all.resize(std::min(all.size(), count));
  return all;
}

void expect_same(const std::vector<NearImage>& found, const std::vector<NearImage>& expected) {
  ASSERT_EQ(found.size(), expected.size());
  for (std::size_t i = 0; i < found.size(); ++i) {
    ASSERT_EQ(found[i].place, expected[i].place) << "rank " << i;
    ASSERT_EQ(found[i].distance, expected[i].distance);
    ASSERT_EQ(found[i].shift, expected[i].shift);
  }
}

class NearestImages : public testing::TestWithParam<Grid> {};

TEST_P(NearestImages, AreThoseOfComparingAll) {
  for (const int kind : {0, 1, 2}) {
    SCOPED_TRACE(kind);
    Places places(GetParam(), 5 + static_cast<unsigned>(kind));
    PlaceStore store;
    std::vector<IntensityScanContext> seen;
    for (std::size_t i = 0; i < 400; ++i) {
      // Random ones, clustered ones, and many that are alike to the bit.
      const bool again = kind > 0 && i % 4 != 0;
      seen.push_back(again       ? places.again(seen[i / 4 * 4], kind == 2 ? 0.0 : 0.05)
                     : kind == 0 ? places.even(0.002 * static_cast<double>(i))
                                 : places.as_scans_are());
      store.add(FrameId{static_cast<std::int64_t>(i)}, 0.1 * static_cast<double>(i), seen.back());
    }
    std::size_t compared = 0, searched = 0;
    for (const std::size_t q : {0u, 101u, 399u}) {
      const IntensityScanContext query = places.again(seen[q], 0.03);
      const std::vector<NearImage> all = compare_all(store, query);
      for (const std::size_t count : {1u, 10u, 25u, 200u, 5000u})
        for (const PlaceRange among : {PlaceRange(1), PlaceRange(64), PlaceRange(249), PlaceRange(400),
                                       PlaceRange(63, 64), PlaceRange(65, 130), PlaceRange(100, 100)})
          for (const std::uint32_t farthest : {UINT32_MAX, 60u, 0u})
            for (const int threads : {1, 3}) {
              SearchCounts counts;
              expect_same(*nearest_images(store, among, query.occupancy.data(), count, farthest, threads, &counts),
                          nearest_of(all, among, count, farthest));
              EXPECT_EQ(counts.places, among.size());
              if (count == 1 && among.size() == 400) {
                compared += counts.compared;
                searched += among.size();
              }
            }
    }
    if (kind == 1 && GetParam().rings > 10) {
      EXPECT_LT(compared, searched * 9 / 10) << "bounds exclude some";
    }
  }
}

// So many places that threads share them, and that parts begin within a chunk of the store.
TEST(LargeStore, IsSearchedInPartsThatLeaveNothingOut) {
  const Grid grid{4, 12};
  Places places(grid, 11);
  PlaceStore store;
  std::vector<IntensityScanContext> some;
  for (int i = 0; i < 500; ++i) some.push_back(places.as_scans_are());
  constexpr std::size_t kPlaces = 25'301;
  for (std::size_t i = 0; i < kPlaces; ++i)
    store.add(FrameId{static_cast<std::int64_t>(i)}, 0.1 * static_cast<double>(i), some[i * i % some.size()]);
  for (int i = 0; i < 4; ++i) {
    const IntensityScanContext query = places.again(some[static_cast<std::size_t>(100 * i)], 0.05);
    const std::vector<NearImage> all = compare_all(store, query);
    for (const PlaceRange among : {PlaceRange(kPlaces), PlaceRange(16'383), PlaceRange(16'400), PlaceRange(24'641),
                                   PlaceRange(130, kPlaces), PlaceRange(4'095, 21'000)})
      for (const std::size_t count : {1u, 40u, 3000u})
        for (const int threads : {1, 2, 3, 8})
          expect_same(*nearest_images(store, among, query.occupancy.data(), count, UINT32_MAX, threads),
                      nearest_of(all, among, count, UINT32_MAX));
  }
  for (const int threads : {1, 2, 3}) {
    SearchCounts counts;
    const IntensityScanContext query = places.again(some[7], 0.05);
    ASSERT_TRUE(nearest_images(store, kPlaces, query.occupancy.data(), kPlaces, UINT32_MAX, threads, &counts));
    EXPECT_EQ(counts.compared, kPlaces) << "of which all are asked for";
  }
}

// Without its bounds the answer would be the same, and the search slow.
TEST(LargeStore, FewPlacesAreCompared) {
  Places places({60, 20}, 17);
  PlaceStore store;
  std::vector<IntensityScanContext> some;
  for (std::size_t i = 0; i < 6000; ++i) {  // each place is seen twenty times
    some.push_back(i % 20 == 0 ? places.as_scans_are() : places.again(some[i / 20 * 20], 0.05));
    store.add(FrameId{static_cast<std::int64_t>(i)}, 0.1 * static_cast<double>(i), some.back());
  }
  std::size_t compared = 0;
  for (std::size_t i = 0; i < 20; ++i) {
    SearchCounts counts;
    const IntensityScanContext query = places.again(some[300 * i], 0.1);
    const auto nearest = *nearest_images(store, 6000, query.occupancy.data(), 10, UINT32_MAX, 1, &counts);
    EXPECT_EQ(nearest[0].place / 20, 15 * i);
    compared += counts.compared;
  }
  EXPECT_EQ(compared, 3'693u) << "fewer is better: each one more is a cost that no answer shows";
}

TEST(LargeStore, NothingIsFoundWhereNothingIsAskedFor) {
  Places places({4, 12}, 11);
  const IntensityScanContext query = places.as_scans_are();
  PlaceStore store;
  store.add(FrameId{0}, 0.0, query);
  EXPECT_TRUE(nearest_images(store, 0, query.occupancy.data(), 5, UINT32_MAX)->empty());
  EXPECT_TRUE(nearest_images(store, 1, query.occupancy.data(), 0, UINT32_MAX)->empty());
  SearchCounts counts;
  EXPECT_EQ(nearest_images(store, 1, query.occupancy.data(), 5, UINT32_MAX, 1, &counts)->size(), 1u);
  EXPECT_EQ(counts.compared, 1u);
  EXPECT_TRUE(nearest_images(store, 1, query.occupancy.data(), 0, UINT32_MAX, 1, &counts)->empty());
  EXPECT_EQ(counts.places, 1u);
  EXPECT_EQ(counts.compared, 0u);
}

INSTANTIATE_TEST_SUITE_P(Grids, NearestImages, testing::Values(Grid{60, 20}, Grid{20, 60}, Grid{3, 5}, Grid{64, 64}),
                         [](const auto& grid) {
                           return std::to_string(grid.param.rings) + "x" + std::to_string(grid.param.sectors);
                         });

TEST(PlaceStore, IsSearchedWhileItGrows) {
  Places places({60, 20}, 9);
  std::vector<IntensityScanContext> seen;
  seen.reserve(6000);
  for (int i = 0; i < 6000; ++i)
    seen.push_back(i < 40 ? places.as_scans_are() : seen[static_cast<std::size_t>(i % 40)]);
  PlaceStore store;
  store.add(FrameId{0}, 0.0, seen[0]);
  std::thread writer([&] {
    for (int i = 1; i < 6000; ++i) store.add(FrameId{i}, 0.1 * i, seen[static_cast<std::size_t>(i)]);
  });
  std::size_t size = 0;
  while (size < 6000) {
    size = store.size();
    const auto found = *nearest_images(store, size, seen[0].occupancy.data(), 3, UINT32_MAX);
    ASSERT_EQ(found[0].place, 0u);
    ASSERT_EQ(found[0].distance, 0u);
    if (found.size() > 1 && size > 40) {
      ASSERT_EQ(found[1].place, 40u);
    }
  }
  writer.join();
}

TEST(PlaceStore, WithoutLayersAPlaceTakesItsImageAlone) {
  Places places({60, 20}, 9);
  PlaceStore store;
  store.add(FrameId{0}, 0.0, places.even(0.3));
  EXPECT_EQ(store.place_bytes(), revisit_bits_place_bytes(60, 20));
}

TEST(PlaceStore, StampsThatRunBackwardsDoNotMakeAPlaceOlder) {
  Places places({60, 20}, 9);
  PlaceStore store;
  for (const double stamp_s : {1.0, 5.0, 2.0, 6.0})
    store.add(FrameId{static_cast<std::int64_t>(store.size())}, stamp_s, places.even(0.3));
  EXPECT_EQ(store.latest_s(2), 5.0);
  PlaceStore second;
  for (const double stamp_s : {5.0, 2.0})
    second.add(FrameId{static_cast<std::int64_t>(second.size())}, stamp_s, places.even(0.3));
  EXPECT_EQ(second.latest_s(1), 5.0);
  EXPECT_EQ(store.latest_s(3), 6.0);
}

}  // namespace
}  // namespace revisit::retrieval_internal
