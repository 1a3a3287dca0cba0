// SPDX-License-Identifier: Apache-2.0
#include <revisit/mapping/build_map.hpp>

#include <cstring>
#include <fstream>
#include <iterator>

#include <algorithm>
#include <tuple>

#include <gtest/gtest.h>

#include <revisit/mapping/internal/moving_points.hpp>
#include <revisit/mapping/internal/tile_files.hpp>

namespace revisit {
namespace {

namespace fs = std::filesystem;

fs::path fresh_folder(const std::string& name) {
  const fs::path folder = fs::path(testing::TempDir()) / ("revisit_mapping_" + name);
  fs::remove_all(folder);
  fs::create_directories(folder);
  return folder;
}

// A wall 20 m to the left, from x = -60 to 140 m, as seen from (x, 0), in the sensor's frame.
std::vector<Point> wall_from(double x_m) {
  std::vector<Point> points;
  for (int i = -300; i < 700; ++i)
    for (int j = -15; j < 15; ++j)
      points.push_back({static_cast<float>(0.2 * i + 0.1 - x_m), 20.05f, 0.2f * static_cast<float>(j) + 0.1f, 0.5f});
  return points;
}

// A box of 2 m at (x, 10), in the frame of a sensor at (sensor_x, 0).
void add_box(std::vector<Point>& points, double x_m, double sensor_x_m) {
  for (int i = -10; i < 10; ++i)
    for (int j = -10; j < 10; ++j)
      points.push_back({static_cast<float>(x_m - sensor_x_m + 0.1 * i), 10.f, 0.1f * static_cast<float>(j), 0.9f});
}

std::vector<Point> read_points(const fs::path& ply) {
  std::ifstream stream(ply, std::ios::binary);
  const std::string all{std::istreambuf_iterator<char>(stream), {}};
  const std::size_t data = all.find("end_header\n") + 11;
  std::vector<Point> points((all.size() - data) / sizeof(Point));
  std::memcpy(points.data(), all.data() + data, points.size() * sizeof(Point));
  return points;
}

TEST(BuildMap, KeepsWhatStaysAndLeavesOutWhatMoves) {
  const fs::path folder = fresh_folder("moving");
  std::vector<Pose> poses;
  for (int i = 0; i < 30; ++i) poses.push_back(planar_pose(i, 0, 0));
  const auto seen = [](std::size_t i) -> Result<std::vector<Point>> {
    const double x_m = static_cast<double>(i);
    auto points = wall_from(x_m);
    add_box(points, 15.0, x_m);               // parked
    add_box(points, -20.0 + 3.0 * x_m, x_m);  // drives by
    return points;
  };
  std::size_t done = 0;
  const auto report = build_map({poses, seen}, {}, folder, [&](std::size_t i) {
    done = i;
    return true;
  });
  ASSERT_TRUE(report) << report.error().message;
  EXPECT_EQ(done, 30u);
  std::size_t parked = 0, passing = 0, wall = 0;
  const auto points = read_points(folder / "map.ply");
  EXPECT_EQ(points.size(), report->points);
  for (const Point& p : points) {
    const bool is_box = p.y < 15.f;
    parked += is_box && std::abs(p.x - 15.f) < 1.2f;
    passing += is_box && std::abs(p.x - 15.f) >= 1.2f;
    wall += !is_box;
  }
  EXPECT_GT(parked, 60u);
  EXPECT_LT(passing, 400u) << "of 30 boxes of 100 voxels";
  EXPECT_GT(wall, 29'000u) << "of 1000 x 30";
  const auto unfiltered = build_map({poses, seen}, {.thin_moving = false}, folder);
  ASSERT_TRUE(unfiltered);
  EXPECT_GT(unfiltered->points, report->points + 1500);
}

// As the ASPRS's table of LAS 1.4 has it.
TEST(CloudFile, LasHasItsBoundsItsPointsAndItsPlaceOnEarth) {
  const fs::path file = fresh_folder("las") / "map.las";
  CloudFile las(file, CloudFormat::kLas, 3, {458000.0, 5428000.0, 0.0}, 32632);
  const std::vector<Point> points{{1.5f, -2.25f, 0.125f, 1.f}, {-10.f, 4.f, 3.f, 0.f}, {0.f, 0.f, -1.f, 0.5f}};
  las.add(std::span(points).first(2));
  las.add(std::span(points).last(1));
  ASSERT_TRUE(las.finish());
  std::ifstream stream(file, std::ios::binary);
  const std::string all{std::istreambuf_iterator<char>(stream), {}};
  const auto at = [&]<typename T>(T value, std::size_t offset) {
    std::memcpy(&value, all.data() + offset, sizeof value);
    return value;
  };
  EXPECT_EQ(all.substr(0, 4), "LASF");
  EXPECT_EQ(at(std::uint8_t{}, 25), 4);
  EXPECT_EQ(at(std::uint16_t{}, 6), 16) << "the projection is well-known text";
  const std::size_t data = at(std::uint32_t{}, 96);
  ASSERT_EQ(all.size(), data + 3 * 30);
  EXPECT_EQ(at(std::uint8_t{}, 104), 6);
  EXPECT_EQ(at(std::uint64_t{}, 247), 3u);
  EXPECT_EQ(at(double{}, 155), 458000.0) << "offset of x";
  EXPECT_EQ(at(double{}, 179), 458001.5) << "largest x";
  EXPECT_EQ(at(double{}, 187), 457990.0) << "smallest x";
  EXPECT_EQ(at(double{}, 219), -1.0) << "smallest z";
  EXPECT_EQ(at(std::int32_t{}, data), 1500);
  EXPECT_EQ(at(std::int32_t{}, data + 4), -2250);
  EXPECT_EQ(at(std::uint16_t{}, data + 12), 65535);
  EXPECT_EQ(at(std::uint32_t{}, 100), 1u);
  EXPECT_EQ(at(std::uint16_t{}, 375 + 18), 2112);
  EXPECT_EQ(375u + 54u + at(std::uint16_t{}, 375 + 20), data);
  EXPECT_NE(all.find("AUTHORITY[\"EPSG\",\"32632\"]"), std::string::npos);
  EXPECT_NE(all.find("\"central_meridian\",9]"), std::string::npos);
}

TEST(BuildMap, AnUnreadableKeyframeAndAFolderThatCannotBe) {
  const auto broken = build_map(
      {{Pose::Identity()}, [](std::size_t) -> Result<std::vector<Point>> { return Error{"key frame 0 is damaged"}; }},
      {}, fresh_folder("broken"));
  ASSERT_FALSE(broken);
  EXPECT_EQ(broken.error().message, "key frame 0 is damaged");
  EXPECT_FALSE(build_map({{Pose::Identity()}, [](std::size_t) { return wall_from(0.0); }}, {}, "/dev/null"));
}

TEST(BuildMap, NothingComesOfNothing) {
  const auto report = build_map({{}, [](std::size_t) { return wall_from(0.0); }}, {}, fresh_folder("empty"));
  ASSERT_TRUE(report);
  EXPECT_EQ(report->points, 0u);
}

TEST(CollectMap, HoldsThePointsOfTheFiles) {
  const fs::path folder = fresh_folder("collected");
  const MapInput input{{planar_pose(100, 100, kPi / 2), planar_pose(101, 100, kPi / 2)},
                       [](std::size_t i) { return wall_from(static_cast<double>(i)); }};
  ASSERT_TRUE(build_map(input, {}, folder));
  auto points = collect_map(input, {});
  ASSERT_TRUE(points);
  std::vector<Point> filed = read_points(folder / "map.ply");
  ASSERT_EQ(points->size(), filed.size());
  const auto before = [](const Point& a, const Point& b) { return std::tie(a.x, a.y, a.z) < std::tie(b.x, b.y, b.z); };
  std::sort(points->begin(), points->end(), before);
  std::sort(filed.begin(), filed.end(), before);
  for (std::size_t i = 0; i < filed.size(); ++i) ASSERT_FLOAT_EQ((*points)[i].x, filed[i].x) << i;
}

TEST(TileFiles, AFileThatIsEmptyOrGoneMeanwhileIsAnError) {
  const fs::path folder = fresh_folder("tile_files");
  mapping_internal::TileFiles files(folder, 10.0);
  ASSERT_TRUE(files.add({{1.f, 2.f, 3.f, 0.5f, 0, 0}}));
  ASSERT_TRUE(files.flush());
  ASSERT_EQ(files.tiles().size(), 1u);
  const fs::path file = fs::directory_iterator(folder)->path();
  fs::resize_file(file, 0);
  const auto emptied = files.take(files.tiles().front());
  ASSERT_FALSE(emptied);
  EXPECT_NE(emptied.error().message.find(file.string()), std::string::npos) << emptied.error().message;
  fs::remove(file);
  EXPECT_FALSE(files.take(files.tiles().front()));
}

TEST(OnePointAVoxel, IsTheMean) {
  const auto points = mapping_internal::one_point_a_voxel(
      {{0.01f, 0.01f, -0.01f, 0.2f, 1, 7}, {0.03f, 0.05f, -0.03f, 0.4f, 2, 9}, {0.3f, 0.f, 0.f, 1.f}}, 0.2);
  ASSERT_EQ(points.size(), 2u);
  EXPECT_NEAR(points[0].x, 0.02f, 1e-6f);
  EXPECT_NEAR(points[0].z, -0.02f, 1e-6f);
  EXPECT_NEAR(points[0].intensity, 0.3f, 1e-6f);
  EXPECT_EQ(points[0].session, 1) << "of the first";
  EXPECT_EQ(points[0].time, 7);
}

}  // namespace
}  // namespace revisit
