// SPDX-License-Identifier: Apache-2.0
#include <stdexcept>

#include <gtest/gtest.h>

#include <revisit/preprocess/range_filter.hpp>

namespace revisit {
namespace {

TEST(FilterRange, KeepsWhatLiesBetweenInOrder) {
  PreprocessOptions options;
  options.min_range_m = 2.0;
  options.max_range_m = 10.0;
  Scan scan;
  for (const float x : {1.9f, 2.f, 5.f, 10.f, 10.1f}) {
    scan.points.push_back({x, 0.f, 0.f, x});
    scan.rings.push_back(static_cast<std::uint16_t>(10.f * x));
    scan.times_s.push_back(x / 100.f);
  }
  scan.points.push_back({6.f, 6.f, 6.f, 1.f});  // 10.39 m away, though each coordinate is near
  scan.rings.push_back(1);
  scan.times_s.push_back(0.f);
  filter_range(scan, options);
  ASSERT_EQ(scan.points.size(), 3u);
  EXPECT_EQ(scan.points[0].x, 2.f);
  EXPECT_EQ(scan.rings, (std::vector<std::uint16_t>{20, 50, 100}));
  EXPECT_EQ(scan.times_s.back(), 0.1f);
}

TEST(FilterRange, RingsOfAnotherNumberThrow) {
  Scan scan;
  scan.points.resize(100);
  scan.rings.resize(10);
  EXPECT_THROW(filter_range(scan, {}), std::invalid_argument);
  EXPECT_THROW(keep_points(scan, [](std::size_t) { return true; }), std::invalid_argument);
}

TEST(FilterRange, EmptyStaysEmpty) {
  Scan scan;
  filter_range(scan, {});
  EXPECT_TRUE(scan.points.empty());
}

}  // namespace
}  // namespace revisit
