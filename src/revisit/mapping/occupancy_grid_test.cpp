// SPDX-License-Identifier: Apache-2.0
#include <revisit/mapping/occupancy_grid.hpp>

#include <fstream>
#include <vector>

#include <gtest/gtest.h>

namespace revisit {
namespace {

// A sensor 1 m above level ground sees a wall at x = 5, a bridge 3 m up at x = 8, and the ground to 10 m elsewhere.
struct Yard {
  std::vector<Point> points;
  std::vector<Eigen::Vector3f> ground;
  Yard() {
    for (int i = -100; i <= 100; ++i)
      for (int j = -100; j <= 100; ++j) {
        const float x = 0.1f * static_cast<float>(i) + 0.05f, y = 0.1f * static_cast<float>(j) + 0.05f;
        if (x > 5.f && y > -2.f && y < 2.f) continue;  // behind the wall
        points.push_back({x, y, -1.f, 0.f});
        if (i % 10 == 0 && j % 10 == 0) ground.emplace_back(x, y, -1.f);
      }
    for (float y = -1.95f; y < 2.f; y += 0.1f)
      for (float z = -0.9f; z < 1.f; z += 0.1f) points.push_back({5.05f, y, z, 0.f});
    for (float y = 4.f; y < 8.f; y += 0.1f) points.push_back({8.f, y, 2.f, 0.f});
  }
};

TEST(OccupancyGrid, AWallIsInTheWayAndABridgeIsNot) {
  const Yard yard;
  const Pose T_map_lidar = planar_pose(100.0, 50.0, kPi / 2);  // x of the sensor is y of the map
  OccupancyGrid grid({});
  grid.add(T_map_lidar, yard.points, yard.ground);
  using Cell = OccupancyGrid::Cell;
  const auto at = [&](double x, double y) {
    const Eigen::Vector3d p = T_map_lidar * Eigen::Vector3d(x, y, 0.0);
    return grid.at(p.x(), p.y());
  };
  EXPECT_EQ(at(3.05, 0.05), Cell::kFree);
  EXPECT_EQ(at(5.05, 0.05), Cell::kOccupied);
  EXPECT_EQ(at(7.05, 0.05), Cell::kUnknown) << "behind the wall";
  EXPECT_EQ(at(8.05, 6.05), Cell::kFree) << "under the bridge";
  EXPECT_EQ(at(50.0, 0.0), Cell::kUnknown);
}

// One that stood there once is gone in what others see.
TEST(OccupancyGrid, WhatIsSeenThroughLaterIsFree) {
  const Yard with_wall;
  Yard without;
  without.points.clear();
  for (int i = 0; i < 100; ++i)
    for (int j = -20; j <= 20; ++j)
      without.points.push_back({0.1f * static_cast<float>(i) + 0.05f, 0.1f * static_cast<float>(j) + 0.05f, -1.f, 0.f});
  OccupancyGrid grid({});
  grid.add(Pose::Identity(), with_wall.points, with_wall.ground);
  EXPECT_EQ(grid.at(5.05, 0.05), OccupancyGrid::Cell::kOccupied);
  for (int i = 0; i < 3; ++i) grid.add(Pose::Identity(), without.points, without.ground);
  EXPECT_EQ(grid.at(5.05, 0.05), OccupancyGrid::Cell::kFree);
}

TEST(OccupancyGrid, IsWrittenAsNavigationLoadsIt) {
  const Yard yard;
  OccupancyGrid grid({.cell_m = 0.2});
  const std::filesystem::path yaml_file = std::filesystem::path(testing::TempDir()) / "revisit_grid.yaml";
  EXPECT_FALSE(grid.write(yaml_file)) << "nothing was added";
  grid.add(Pose::Identity(), yard.points, yard.ground);
  ASSERT_TRUE(grid.write(yaml_file));
  std::ifstream yaml(yaml_file);
  const std::string text((std::istreambuf_iterator<char>(yaml)), {});
  EXPECT_NE(text.find("image: revisit_grid.pgm"), std::string::npos) << text;
  EXPECT_NE(text.find("origin: [-9.8, -9.8, 0.0]"), std::string::npos) << text;
  std::ifstream pgm(std::filesystem::path(yaml_file).replace_extension(".pgm"), std::ios::binary);
  std::string magic, comment;
  std::size_t width = 0, height = 0, most = 0;
  std::getline(pgm, magic);
  std::getline(pgm, comment);
  pgm >> width >> height >> most;
  EXPECT_EQ(magic, "P5");
  EXPECT_EQ(most, 255u);
  pgm.get();
  std::vector<char> image(width * height);
  ASSERT_TRUE(pgm.read(image.data(), static_cast<std::streamsize>(image.size())));
  // Rows come from the top; the lower left corner is the origin.
  const auto pixel = [&](double x, double y) {
    const auto column = static_cast<std::size_t>((x + 9.8) / 0.2), row = static_cast<std::size_t>((y + 9.8) / 0.2);
    return image[(height - 1 - row) * width + column];
  };
  EXPECT_EQ(pixel(5.1, 1.1), '\0');
  EXPECT_EQ(pixel(3.1, 1.1), '\xfe');
  EXPECT_EQ(pixel(5.1, -3.1), '\xfe') << "beside the wall";
  EXPECT_EQ(pixel(7.1, 0.1), '\xcd');
  EXPECT_FALSE(grid.write("/no/such/folder/grid.yaml"));
}

}  // namespace
}  // namespace revisit
