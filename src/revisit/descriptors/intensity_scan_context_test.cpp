// SPDX-License-Identifier: Apache-2.0
#include <revisit/descriptors/intensity_scan_context.hpp>

#include <cmath>
#include <stdexcept>

#include <gtest/gtest.h>

#include "random_points.hpp"

namespace revisit {
namespace {

using testing_support::random_points;

TEST(Describe, ACellIsWhatItsPointsMakeIt) {
  DescriptorOptions options;
  options.rings = 10;
  options.sectors = 4;
  options.levels = 0;
  options.max_range_m = 50.0;
  // Sector 2 is theta in [0, pi/2), ring 1 is rho in [5, 10).
  const std::vector<Point> points = {
      {6.f, 1.f, 0.f, 0.2f}, {7.f, 2.f, 5.f, 0.6f}, {-30.f, -1.f, 0.f, 0.f}, {60.f, 0.f, 0.f, 1.f}};
  const IntensityScanContext context = describe(points, options);
  EXPECT_EQ(context.occupied_cells(), 2) << "the point beyond 50 m is left out";
  EXPECT_TRUE(context.occupied(1, 2));
  EXPECT_EQ(context.intensity[2 * 10 + 1], quantise_intensity(0.6f)) << "the largest of the cell";
  EXPECT_TRUE(context.occupied(6, 0)) << "a return without intensity is a return";
  EXPECT_EQ(context.intensity[0 * 10 + 6], 0);
}

TEST(Describe, LayersHoldWhatStandsHigher) {
  DescriptorOptions options;
  options.rings = 10;
  options.sectors = 4;
  options.levels = 3;
  options.max_range_m = 50.0;
  const double ground_z_m = -2.0;  // layers above -1.5, 0.5 and 2.5
  const std::vector<Point> points = {{6.f, 1.f, -1.9f, 0.9f},
                                     {12.f, 1.f, -1.5f, 0.f},
                                     {17.f, 1.f, 0.6f, 0.f},
                                     {22.f, 1.f, 50.f, 0.f},
                                     {22.f, 2.f, -1.f, 0.f}};
  const IntensityScanContext context = describe(points, options, ground_z_m);
  const auto layers = [&](int ring) {
    return std::vector<bool>{context.occupied(ring, 2, 0), context.occupied(ring, 2, 1), context.occupied(ring, 2, 2)};
  };
  EXPECT_EQ(layers(1), (std::vector<bool>{false, false, false})) << "ground";
  EXPECT_EQ(layers(2), (std::vector<bool>{true, false, false})) << "at the border";
  EXPECT_EQ(layers(3), (std::vector<bool>{true, true, false}));
  EXPECT_EQ(layers(4), (std::vector<bool>{true, true, true})) << "the highest point counts";
  EXPECT_EQ(context.occupied_cells(), 6);
  EXPECT_EQ(context.intensity[2 * 10 + 1], quantise_intensity(0.9f)) << "intensities are of all points";
}

TEST(Describe, NoPointsNoCells) {
  EXPECT_EQ(describe({}, {}).occupied_cells(), 0);
  const Point one{3.f, 4.f, -1.f, 0.5f};
  EXPECT_EQ(describe(std::span<const Point>(&one, 1), {}).occupied_cells(), 1);
}

TEST(Describe, RotationByASectorIsAShiftByAColumn) {
  for (const auto& [rings, sectors] : {std::pair{60, 20}, {20, 60}}) {
    DescriptorOptions options;
    options.rings = rings;
    options.sectors = sectors;
    const auto points = random_points(5000, 1);
    const IntensityScanContext before = describe(points, options);
    for (int k = 0; k < sectors; ++k) {
      const double angle = k * 2.0 * 3.14159265358979323846 / sectors;
      std::vector<Point> turned = points;
      std::vector<Point> kept, kept_turned;
      for (std::size_t i = 0; i < points.size(); ++i) {
        const double x = points[i].x, y = points[i].y;
        // Points within float rounding of a border may fall on either side: they say nothing about shifts.
        const double ring = std::hypot(x, y) * rings / options.max_range_m;
        const double sector = (std::atan2(y, x) + 3.14159265358979323846) * sectors / 6.283185307179586;
        if (std::abs(ring - std::round(ring)) < 1e-4 || std::abs(sector - std::round(sector)) < 1e-4) continue;
        kept.push_back(points[i]);
        turned[i].x = static_cast<float>(x * std::cos(angle) - y * std::sin(angle));
        turned[i].y = static_cast<float>(x * std::sin(angle) + y * std::cos(angle));
        kept_turned.push_back(turned[i]);
      }
      const IntensityScanContext a = describe(kept, options), b = describe(kept_turned, options);
      for (int j = 0; j < sectors; ++j)
        for (int i = 0; i < rings; ++i) {
          const int to = (j + k) % sectors;
          ASSERT_EQ(a.intensity[static_cast<std::size_t>(j * rings + i)],
                    b.intensity[static_cast<std::size_t>(to * rings + i)]);
          ASSERT_EQ(a.occupied(i, j), b.occupied(i, to));
        }
    }
    EXPECT_GT(before.occupied_cells(), 100);
  }
}

TEST(Describer, ReusedMemoryHoldsNothingOfTheScanBefore) {
  Describer describer(DescriptorOptions{});
  IntensityScanContext result;
  describer.describe(random_points(5000, 2), result);
  const auto points = random_points(300, 3);
  describer.describe(points, result);
  const IntensityScanContext fresh = describe(points, {});
  EXPECT_EQ(result.intensity, fresh.intensity);
  EXPECT_EQ(result.occupancy, fresh.occupancy);
}

TEST(Describe, GridsOutsideTheAllowedRangeThrow) {
  DescriptorOptions options;
  options.rings = 0;
  EXPECT_THROW((void)describe({}, options), std::invalid_argument);
  options = {};
  options.max_range_m = 0.0;
  EXPECT_THROW((void)describe({}, options), std::invalid_argument);
}

TEST(QuantiseIntensity, CutsToTheByte) {
  EXPECT_EQ(quantise_intensity(0.f), 0);
  EXPECT_EQ(quantise_intensity(-1.f), 0);
  EXPECT_EQ(quantise_intensity(std::nanf("")), 0);
  EXPECT_EQ(quantise_intensity(1.f), 255);
  EXPECT_EQ(quantise_intensity(7.f), 255);
  EXPECT_EQ(quantise_intensity(0.5f), 128);
}

}  // namespace
}  // namespace revisit
