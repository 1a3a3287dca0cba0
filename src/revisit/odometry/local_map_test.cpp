// SPDX-License-Identifier: Apache-2.0
#include <revisit/odometry/local_map.hpp>

#include <stdexcept>
#include <vector>

#include <gtest/gtest.h>

namespace revisit {
namespace {

std::vector<Eigen::Vector3f> floor_around(float x0, float half_m) {
  std::vector<Eigen::Vector3f> points;
  for (float x = x0 - half_m; x < x0 + half_m; x += 0.2f)
    for (float y = -half_m; y < half_m; y += 0.2f) points.emplace_back(x, y, -1.7f);
  return points;
}

TEST(LocalMap, KnowsTheSurfaceNearby) {
  LocalMap map(1.0, 50.0);
  Surface::Patch patch;
  EXPECT_FALSE(map.nearest_patch({0, 0, -1.7f}, 1.f, patch)) << "nothing was seen yet";
  map.add(floor_around(0.f, 10.f));
  ASSERT_TRUE(map.nearest_patch({3.1f, -2.2f, -1.4f}, 1.f, patch));
  EXPECT_NEAR(std::abs(patch.normal.z()), 1.f, 1e-3f);
  EXPECT_NEAR(patch.point.z(), -1.7f, 1e-3f);
  EXPECT_FALSE(map.nearest_patch({3.1f, -2.2f, 2.f}, 1.f, patch)) << "the reach is a metre";
}

TEST(LocalMap, LinesAVoxelApartMakeASurface) {
  LocalMap map(1.0, 50.0);
  std::vector<Eigen::Vector3f> lines;  // as a sparse sensor draws them on the ground
  for (int line = 0; line < 8; ++line)
    for (float y = -5.f; y < 5.f; y += 0.2f) lines.emplace_back(static_cast<float>(line) + 0.5f, y, -1.7f);
  map.add(lines);
  map.add(lines);  // the first ones did not know their neighbours yet
  Surface::Patch patch;
  ASSERT_TRUE(map.nearest_patch({3.4f, 0.3f, -1.5f}, 1.f, patch));
  EXPECT_NEAR(std::abs(patch.normal.z()), 1.f, 1e-3f);
}

// A floor, grass of ten centimetres, and a floor of which a single line was seen with a trace of width.
TEST(LocalMap, SaysHowCertainASurfaceIs) {
  const auto variance_m2 = [](float height_m, float width_m) {
    LocalMap map(1.0, 50.0);
    std::vector<Eigen::Vector3f> points;
    for (int i = 0; i < 100; ++i) {
      const auto a = static_cast<float>(i % 10), b = static_cast<float>(i / 10), c = static_cast<float>(7 * i % 10);
      points.emplace_back(0.05f + 0.1f * a, 0.5f + width_m * (0.1f * b - 0.45f), 0.5f + height_m * (0.1f * c - 0.45f));
    }
    map.add(points);
    Surface::Patch patch;
    EXPECT_TRUE(map.nearest_patch({0.5f, 0.5f, 0.5f}, 1.f, patch));
    EXPECT_NEAR(std::abs(patch.normal.z()), 1.f, 0.1f);
    return patch.variance_m2;
  };
  const float floor_m2 = variance_m2(0.01f, 1.f);
  EXPECT_GT(floor_m2, 0.f);
  EXPECT_GT(variance_m2(0.2f, 1.f), 5.f * floor_m2);
  EXPECT_GT(variance_m2(0.01f, 0.2f), 1.2f * floor_m2);
}

TEST(LocalMap, WhatIsNoSurfaceGivesNone) {
  LocalMap map(1.0, 50.0);
  std::vector<Eigen::Vector3f> corners;
  for (int corner = 0; corner < 8; ++corner)
    corners.emplace_back(corner & 1 ? 0.9f : 0.1f, corner & 2 ? 0.9f : 0.1f, corner & 4 ? 0.9f : 0.1f);
  map.add(corners);
  Surface::Patch patch;
  EXPECT_FALSE(map.nearest_patch({0.5f, 0.5f, 0.5f}, 1.f, patch));
}

TEST(LocalMap, ForgetsWhatLiesFarAndStaysBounded) {
  LocalMap map(1.0, 20.0);
  std::size_t most = 0;
  for (int step = 0; step < 30; ++step) {
    map.add(floor_around(10.f * static_cast<float>(step), 15.f));
    map.forget_far_from({10.f * static_cast<float>(step), 0.f, 0.f});
    if (step == 5) most = map.voxels();
    if (step > 5) {
      EXPECT_LE(map.voxels(), most + most / 10);
    }
  }
  Surface::Patch patch;
  EXPECT_FALSE(map.nearest_patch({0, 0, -1.7f}, 1.f, patch)) << "left long ago";
  EXPECT_THROW(LocalMap(0.0, 20.0), std::invalid_argument);
}

}  // namespace
}  // namespace revisit
