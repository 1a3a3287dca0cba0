// SPDX-License-Identifier: Apache-2.0
#include <revisit/descriptors/internal/polar_binning.hpp>

#include <cmath>
#include <limits>
#include <random>
#include <set>
#include <string>

#include <gtest/gtest.h>

#include <revisit/bits/instruction_sets.hpp>

namespace revisit::descriptors_internal {
namespace {

// Random points, and points placed right on the borders of cells, where float arithmetic goes astray.
std::vector<Point> hard_points(const PolarGrid& grid, std::size_t count, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> turn(-4.0, 4.0), range(0.0, 1.2 * grid.max_range_m), reading(-0.2, 1.3);
  std::vector<Point> points;
  for (std::size_t i = 0; i < count; ++i) {
    double rho = range(random), theta = turn(random);
    if (i % 5 == 1) rho = std::floor(rho * grid.rings / grid.max_range_m) * grid.max_range_m / grid.rings;
    if (i % 5 == 2) theta = std::floor(theta * grid.sectors / 6.283185307179586) * 6.283185307179586 / grid.sectors;
    points.push_back({static_cast<float>(rho * std::cos(theta)), static_cast<float>(rho * std::sin(theta)), 0.f,
                      static_cast<float>(reading(random))});
  }
  const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
  for (const Point& odd : {Point{0, 0, 0, 0.5f},
                           {nan, 1, 0, 0.5f},
                           {1, inf, 0, 0.5f},
                           {3, 1, 0, nan},
                           {-5, 0.f, 0, 0.5f},
                           {-5, -0.f, 0, 0.7f},
                           {1e30f, 1e30f, 0, 1},
                           {5, 0, 0, 0.f},
                           {0, -5, 0, 2.f}})
    points.push_back(odd);
  return points;
}

class EveryTarget : public testing::Test {
 protected:
  ~EveryTarget() override { force_instruction_set(0); }
};

TEST_F(EveryTarget, EqualsTheScalarReferenceBitForBit) {
  std::set<std::string> names;
  const auto targets = supported_instruction_sets();
  for (const std::int64_t target : targets) {
    force_instruction_set(target);
    names.insert(instruction_set_name());
    for (const PolarGrid& grid :
         {PolarGrid{60, 20, 50.0}, {20, 60, 50.0}, {1, 1, 10.0}, {512, 720, 80.0}, {7, 13, 33.3}}) {
      for (const std::size_t count : {0u, 1u, 15u, 20000u}) {
        const auto points = hard_points(grid, count, 9);
        std::vector<std::uint16_t> fast(static_cast<std::size_t>(grid.rings * grid.sectors) + 1, 0), slow = fast;
        std::vector<std::uint8_t> fast_tops(fast.size(), 0), slow_tops = fast_tops;
        const Levels levels{-1.2f, 0.7f, count % 2 == 0 ? 4 : 0};
        bin_points(points.data(), points.size(), grid, levels, fast.data(), fast_tops.data());
        bin_points_scalar(points.data(), points.size(), grid, levels, slow.data(), slow_tops.data());
        fast.back() = slow.back() = 0;  // beyond the range
        fast_tops.back() = slow_tops.back() = 0;
        EXPECT_EQ(fast_tops, slow_tops) << instruction_set_name();
        EXPECT_EQ(fast, slow) << instruction_set_name() << ", " << grid.rings << " x " << grid.sectors;
      }
    }
  }
  EXPECT_EQ(names.size(), targets.size()) << "forcing a target must change what runs";
}

}  // namespace
}  // namespace revisit::descriptors_internal
