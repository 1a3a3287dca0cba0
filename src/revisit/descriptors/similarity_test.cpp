// SPDX-License-Identifier: Apache-2.0
#include <revisit/descriptors/similarity.hpp>

#include <cmath>
#include <random>
#include <stdexcept>

#include <gtest/gtest.h>

namespace revisit {
namespace {

IntensityScanContext random_context(int rings, int sectors, double density, unsigned seed) {
  std::mt19937 random(seed);
  std::bernoulli_distribution occupied(density);
  std::uniform_int_distribution<int> reading(0, 255);
  IntensityScanContext context{
      rings, sectors, 0, std::vector<std::uint8_t>(static_cast<std::size_t>(rings * sectors)), {}};
  context.occupancy.assign((context.cells() + 63) / 64, 0);
  for (std::size_t i = 0; i < context.cells(); ++i)
    if (occupied(random)) {
      context.intensity[i] = static_cast<std::uint8_t>(reading(random));
      context.occupancy[i / 64] |= std::uint64_t{1} << (i % 64);
    }
  return context;
}

IntensityScanContext turned(const IntensityScanContext& context, int shift) {
  IntensityScanContext result = context;
  result.occupancy.assign(context.occupancy.size(), 0);
  for (int j = 0; j < context.sectors; ++j)
    for (int i = 0; i < context.rings; ++i) {
      const auto to = static_cast<std::size_t>(((j + shift) % context.sectors) * context.rings + i);
      result.intensity[to] = context.intensity[static_cast<std::size_t>(j * context.rings + i)];
      if (context.occupied(i, j)) result.occupancy[to / 64] |= std::uint64_t{1} << (to % 64);
    }
  return result;
}

TEST(MatchDescriptors, ATurnedPlaceScoresFullAndTellsItsYaw) {
  const IntensityScanContext place = random_context(60, 20, 0.3, 1);
  for (int k = 0; k < 20; ++k) {
    const LoopCandidate match = match_descriptors(place, turned(place, k));
    EXPECT_DOUBLE_EQ(match.geometry_score, 1.0);
    EXPECT_NEAR(match.intensity_score, 1.0, 1e-12);
    EXPECT_EQ(match.shift_columns, k);
    EXPECT_NEAR(std::remainder(match.yaw_rad - k * 2.0 * kPi / 20, 2.0 * kPi), 0.0, 1e-12);
  }
}

TEST(MatchIntensity, EmptyColumnsDoNotCount) {
  IntensityScanContext a{2, 3, 0, {10, 20, 0, 0, 0, 0}, {0b000011}};
  IntensityScanContext b = a;
  EXPECT_NEAR(match_intensity(a, b, 0), 1.0, 1e-12) << "two columns are empty in both";
  b.intensity[2] = 50;  // now one of them is empty in one scan only
  EXPECT_NEAR(match_intensity(a, b, 0), 0.5, 1e-12);
  const IntensityScanContext none{2, 3, 0, std::vector<std::uint8_t>(6, 0), {0}};
  EXPECT_EQ(match_intensity(none, none, 0), 0.0);
}

TEST(MatchDescriptors, DifferentGridsThrow) {
  EXPECT_THROW((void)match_descriptors(random_context(60, 20, 0.3, 1), random_context(20, 60, 0.3, 1)),
               std::invalid_argument);
}

}  // namespace
}  // namespace revisit
