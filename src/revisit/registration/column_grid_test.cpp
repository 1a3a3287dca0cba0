// SPDX-License-Identifier: Apache-2.0
#include <revisit/registration/internal/column_grid.hpp>

#include <algorithm>
#include <random>

#include <gtest/gtest.h>

namespace revisit {
namespace {

using registration_internal::ColumnGrid;

std::vector<Eigen::Vector3f> random_cloud(unsigned seed, std::size_t count) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> at(-40.f, 40.f), height(-2.f, 6.f);
  std::vector<Eigen::Vector3f> points(count);
  for (auto& p : points) p = {at(random), at(random), height(random)};
  return points;
}

TEST(ColumnGrid, FindsWhatComparingAllFinds) {
  const auto points = random_cloud(1, 2000), queries = random_cloud(2, 200);
  const ColumnGrid grid(points, 1.f);
  for (const auto& q : queries) {
    std::vector<std::size_t> within, by_hand;
    grid.for_each_within(q, 3.5f, [&](std::size_t i, float) { within.push_back(i); });
    std::size_t nearest = 0, index = 0;
    for (std::size_t i = 0; i < points.size(); ++i) {
      if ((points[i] - q).squaredNorm() < 3.5f * 3.5f) by_hand.push_back(i);
      if ((points[i] - q).squaredNorm() < (points[nearest] - q).squaredNorm()) nearest = i;
    }
    std::sort(within.begin(), within.end());
    EXPECT_EQ(within, by_hand);
    float squared_m2 = 0.f;
    ASSERT_TRUE(grid.nearest(q, 1e4f, index, squared_m2));
    EXPECT_EQ(index, nearest);
    EXPECT_FLOAT_EQ(squared_m2, (points[nearest] - q).squaredNorm());
  }
}

TEST(ColumnGrid, NothingIsFoundBeyondTheReachOrInAnEmptyGrid) {
  std::size_t index = 0;
  float squared_m2 = 0.f;
  EXPECT_FALSE(ColumnGrid({}, 1.f).nearest({0.f, 0.f, 0.f}, 100.f, index, squared_m2));
  const std::vector<Eigen::Vector3f> one = {{10.f, 0.f, 0.f}};
  EXPECT_FALSE(ColumnGrid(one, 1.f).nearest({0.f, 0.f, 0.f}, 99.f, index, squared_m2));
  EXPECT_TRUE(ColumnGrid(one, 1.f).nearest({0.f, 0.f, 0.f}, 101.f, index, squared_m2));
}

}  // namespace
}  // namespace revisit
