// SPDX-License-Identifier: Apache-2.0
#include <revisit/retrieval/place_index.hpp>

#include <algorithm>
#include <stdexcept>

#include <gtest/gtest.h>

#include <revisit/descriptors/similarity.hpp>

#include "random_points.hpp"

namespace revisit {
namespace {

IntensityScanContext random_context(unsigned seed) { return describe(testing_support::random_points(600, seed), {}); }

PlaceIndex filled(const RetrievalOptions& options, int places) {
  PlaceIndex index(options);
  for (int i = 0; i < places; ++i) index.add(FrameId{i}, 0.1 * i, random_context(static_cast<unsigned>(i)));
  return index;
}

TEST(PlaceIndex, ExcludesTheRecentPastByFramesAndByTime) {
  RetrievalOptions options;
  options.separation_frames = 0;
  options.exclude_frames = 50;
  options.exclude_s = 8.0;
  options.top_k = 1000;
  options.shortlist = 0;
  const PlaceIndex index = filled(options, 200);
  const auto latest = [&](int frame, double stamp_s) {
    std::int64_t last = -1;
    const auto found = index.search(random_context(7), index.searchable({FrameId{frame}, stamp_s}));
    for (const auto& each : *found) last = std::max(last, each.match.value);
    return last;
  };
  EXPECT_EQ(latest(200, 20.0), 120) << "8 s are 80 frames here";
  EXPECT_EQ(latest(200, 100.0), 150) << "50 frames";
  EXPECT_EQ(latest(79, 7.9), -1);
  EXPECT_EQ(index.searchable({FrameId{79}, 7.9}), 0u);
  ASSERT_EQ(index.searchable({FrameId{85}, 8.5}), 6u);
  EXPECT_EQ(index.frame(5).value, 5);
  EXPECT_EQ(index.until(FrameId{7}), 8u);
  EXPECT_EQ(index.until(FrameId{700}), 200u);
}

TEST(PlaceIndex, TheFirstPlaceCanBeFound) {
  const PlaceIndex index = filled({}, 100);
  const auto found = *index.search(random_context(0), index.size());
  ASSERT_FALSE(found.empty());
  EXPECT_EQ(found[0].match.value, 0);
  EXPECT_DOUBLE_EQ(found[0].geometry_score, 1.0);
}

TEST(PlaceIndex, RanksAsComparingAllByHand) {
  RetrievalOptions options;
  options.shortlist = 0;
  options.top_k = 10;
  options.separation_frames = 0;
  options.intensity_weight = 1.0;
  const PlaceIndex index = filled(options, 120);
  const IntensityScanContext query = random_context(1000);
  std::vector<std::pair<double, std::int64_t>> by_hand;
  for (int i = 0; i < 120; ++i)
    by_hand.emplace_back(-match_descriptors(query, random_context(static_cast<unsigned>(i))).score(), i);
  std::sort(by_hand.begin(), by_hand.end());
  const auto found = *index.search(query, index.size());
  ASSERT_EQ(found.size(), 10u);
  for (std::size_t i = 0; i < found.size(); ++i) {
    EXPECT_EQ(found[i].match.value, by_hand[i].second);
    EXPECT_DOUBLE_EQ(found[i].score(), -by_hand[i].first);
  }
}

TEST(PlaceIndex, OfPlacesFewFramesApartTheBestIsReturned) {
  RetrievalOptions options;
  options.shortlist = 0;
  options.top_k = 1000;
  options.separation_frames = 0;
  const auto all = filled(options, 100).search(random_context(5), 100);
  options.separation_frames = 8;
  const auto apart = filled(options, 100).search(random_context(5), 100);
  EXPECT_EQ((*apart)[0].match, (*all)[0].match);
  EXPECT_GE(apart->size(), 6u);
  for (std::size_t i = 0; i < apart->size(); ++i)
    for (std::size_t j = 0; j < i; ++j) EXPECT_GT(std::abs((*apart)[i].match.value - (*apart)[j].match.value), 8);
  // Whatever is left out is near one that is better.
  for (std::size_t i = 0; i < all->size(); ++i) {
    bool is_near = false;
    for (const auto& kept : *apart) is_near = is_near || std::abs(kept.match.value - (*all)[i].match.value) <= 8;
    EXPECT_TRUE(is_near);
  }
}

TEST(PlaceIndex, GatesAndShortlistAreKept) {
  RetrievalOptions options;
  options.top_k = 1000;
  options.separation_frames = 0;
  options.shortlist = 7;
  EXPECT_EQ(filled(options, 100).search(random_context(5), 100)->size(), 7u);
  options.shortlist = 1;
  EXPECT_EQ(filled(options, 100).search(random_context(5), 100)->size(), 1u);
  options.shortlist = 0;
  options.min_geometry_score = 0.999;
  EXPECT_EQ(filled(options, 100).search(random_context(5), 100)->size(), 1u) << "itself alone";
  options.min_geometry_score = 0.0;
  options.min_intensity_score = 0.999;
  EXPECT_EQ(filled(options, 100).search(random_context(5), 100)->size(), 1u);
}

// Without layers of height the score follows from the distance: what passes by exactly nothing is found, too.
TEST(PlaceIndex, AScoreAtTheGateIsFoundWhateverItsRounding) {
  DescriptorOptions flat;
  flat.levels = 0;
  const IntensityScanContext query = describe(testing_support::random_points(600, 4), flat);
  IntensityScanContext other = query;
  for (std::size_t i = 0; i < 300; ++i) {
    other.occupancy[i / 64] ^= std::uint64_t{1} << (i % 64);
    RetrievalOptions options;
    const double score = match_descriptors(query, other).geometry_score;
    options.min_geometry_score = score;
    options.min_intensity_score = 0.0;
    PlaceIndex index(options);
    index.add(FrameId{0}, 0.0, other);
    EXPECT_EQ(index.search(query, 1)->size(), 1u) << score;
    options.min_intensity_score = match_descriptors(query, other).intensity_score;
    PlaceIndex with_intensity(options);
    with_intensity.add(FrameId{0}, 0.0, other);
    EXPECT_EQ(with_intensity.search(query, 1)->size(), 1u) << score;
    options.min_intensity_score = 0.0;
    options.min_geometry_score = score + 1e-9;
    PlaceIndex stricter(options);
    stricter.add(FrameId{0}, 0.0, other);
    EXPECT_TRUE(stricter.search(query, 1)->empty()) << score;
  }
}

// What cannot reach the gate is not looked at.
TEST(PlaceIndex, WithoutLayersTheGateSparesComparisons) {
  DescriptorOptions flat;
  flat.levels = 0;
  RetrievalOptions options;
  options.shortlist = 0;
  SearchEffort effort[2];
  for (const int strict : {0, 1}) {
    options.min_geometry_score = strict == 1 ? 0.95 : 0.0;
    PlaceIndex index(options);
    for (int i = 0; i < 100; ++i)
      index.add(FrameId{i}, 0.1 * i, describe(testing_support::random_points(600, static_cast<unsigned>(i)), flat));
    ASSERT_TRUE(index.search(describe(testing_support::random_points(600, 5), flat), 100, 1, &effort[strict]));
  }
  EXPECT_EQ(effort[0].compared, 100u);
  EXPECT_LT(effort[1].compared, 60u);
}

TEST(PlaceIndex, MisuseThrows) {
  PlaceIndex index = filled({}, 3);
  EXPECT_THROW(index.add(FrameId{2}, 1.0, random_context(1)), std::invalid_argument);
  DescriptorOptions fewer_rings, fewer_sectors, fewer_levels;
  fewer_rings.rings = 5;
  fewer_sectors.sectors /= 2;
  fewer_levels.levels -= 1;
  for (const int places : {1, 3})
    for (const DescriptorOptions& other : {fewer_rings, fewer_sectors, fewer_levels})
      EXPECT_THROW(filled({}, places).add(FrameId{9}, 1.0, describe({}, other)), std::invalid_argument);
  EXPECT_FALSE(index.find(FrameId{9}));
  index.add(FrameId{7}, 1.0, random_context(7));
  EXPECT_FALSE(index.find(FrameId{5})) << "between two that are there";
  ASSERT_TRUE(index.find(FrameId{2}));
  EXPECT_EQ(index.find(FrameId{2})->occupancy[0], random_context(2).occupancy[0]);

  PlaceIndex second = filled({}, 1);
  EXPECT_THROW(second.add(FrameId{0}, 1.0, random_context(1)), std::invalid_argument) << "the second place, too";
}

TEST(PlaceIndex, AnotherGridIsNotCompared) {
  const PlaceIndex index = filled({}, 3);
  DescriptorOptions fewer_rings, fewer_sectors, fewer_levels;
  fewer_rings.rings -= 1;
  fewer_sectors.sectors /= 2;
  fewer_levels.levels -= 1;
  for (const DescriptorOptions& each : {fewer_rings, fewer_sectors, fewer_levels})
    for (const std::size_t places : {1u, 3u})
      EXPECT_THROW((void)index.search(describe(testing_support::random_points(600, 1), each), places),
                   std::invalid_argument);
  EXPECT_TRUE(index.search(describe({}, fewer_rings), 0)->empty()) << "nothing is compared";
}

}  // namespace
}  // namespace revisit
