// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <stdexcept>

#include <gtest/gtest.h>

#include <revisit/preprocess/range_filter.hpp>

namespace revisit {
namespace {

TEST(FilterRange, RaisesElevationsAndKeepsRangesAndAzimuths) {
  PreprocessOptions options;
  options.elevation_offset_deg = 0.5;
  Scan scan;
  scan.points = {{3.f, -4.f, -1.f, 0.f}, {0.f, 0.f, 5.f, 0.f}};
  filter_range(scan, options);
  const Point& p = scan.points[0];
  EXPECT_NEAR(std::hypot(p.x, p.y, p.z), std::sqrt(26.f), 1e-5f);
  EXPECT_NEAR(std::atan2(p.y, p.x), std::atan2(-4.f, 3.f), 1e-6f);
  EXPECT_NEAR(std::atan2(p.z, std::hypot(p.x, p.y)), std::atan2(-1.f, 5.f) + 0.5f * 3.14159265f / 180.f, 1e-6f);
  EXPECT_EQ(scan.points[1].z, 5.f) << "overhead there is no azimuth";
}

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
