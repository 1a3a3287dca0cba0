// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <fstream>
#include <iterator>
#include <map>
#include <random>
#include <set>
#include <tuple>

#include <tbb/task_arena.h>

#include <revisit/mapping/build_map.hpp>
#include <revisit/mapping/internal/octree.hpp>
#include <revisit/mapping/tileset_writer.hpp>

namespace revisit {
namespace {

namespace fs = std::filesystem;
using mapping_internal::Octree;
using mapping_internal::OctreeNode;
using mapping_internal::split_square;

fs::path tileset_folder(const std::string& name) {
  const fs::path folder = fs::path(testing::TempDir()) / ("revisit_tileset_" + name);
  fs::remove_all(folder);
  fs::create_directories(folder);
  return folder;
}

std::string bytes_of(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

// A number that follows a name in the head of a file.
std::vector<double> numbers_after(const std::string& text, const std::string& name, int count) {
  std::vector<double> numbers;
  std::size_t at = text.find(name) + name.size();
  for (int i = 0; i < count; ++i) {
    std::size_t used = 0;
    numbers.push_back(std::stod(text.substr(at, 30), &used));
    at += used + 1;
  }
  return numbers;
}

// As glTF 2.0, 3D Tiles 1.1 (y up becomes z up) and KHR_mesh_quantization have it.
std::vector<MapPoint> read_glb(const fs::path& file) {
  const std::string all = bytes_of(file);
  const auto word = [&](std::size_t at) {
    std::uint32_t value = 0;
    std::memcpy(&value, all.data() + at, 4);
    return value;
  };
  EXPECT_EQ(word(0), 0x46546C67u);
  EXPECT_EQ(word(4), 2u);
  EXPECT_EQ(word(8), all.size()) << file;
  const std::string json = all.substr(20, word(12));
  const auto t = numbers_after(json, "\"translation\":[", 3), s = numbers_after(json, "\"scale\":[", 1);
  const std::size_t data = 20 + json.size() + 8;
  EXPECT_EQ(data % 4, 0u);
  EXPECT_EQ(word(data - 8), all.size() - data);
  std::vector<MapPoint> points;
  for (std::size_t at = data; at < all.size(); at += 12) {
    std::uint16_t row[6];
    std::memcpy(row, all.data() + at, 12);
    points.push_back({static_cast<float>(t[0] + s[0] * row[0]), static_cast<float>(-t[2] + s[0] * row[1]),
                      static_cast<float>(t[1] + s[0] * row[2]), static_cast<float>(row[4] & 0xFF) / 255.f,
                      static_cast<std::uint16_t>(row[4] >> 8), row[5]});
  }
  return points;
}

// Streets of a town: ground and walls, a point a voxel of 0.2 m; 4 by 4 squares about the origin.
std::vector<TilesetWriter::Square> town(double side_m = 204.8) {
  std::map<std::uint64_t, TilesetWriter::Square> squares;
  const double square_m = TilesetWriter::square_m(0.2);
  std::mt19937 random(3);
  std::uniform_real_distribution<double> of_voxel(0.0, 0.2);
  const auto add = [&](double x, double y, double z) {
    const double px = x + of_voxel(random), py = y + of_voxel(random), pz = z + of_voxel(random);
    const auto i = static_cast<std::uint32_t>(px / square_m), j = static_cast<std::uint32_t>(py / square_m);
    auto& square = squares[TilesetWriter::order(i, j)];
    square.x = i;
    square.y = j;
    square.points.push_back({static_cast<float>(px - 100.0), static_cast<float>(py - 100.0),
                             static_cast<float>(pz - 2.0), static_cast<float>(i % 2), static_cast<std::uint16_t>(j),
                             static_cast<std::uint16_t>(1000 * i)});
  };
  for (double x = 0.0; x < side_m - 0.3; x += 0.2) {
    for (double y = 0.0; y < side_m - 0.3; y += 0.4) add(x, y, 0.0);
    for (double z = 0.2; z < 12.0; z += 0.2) add(x, 60.0, z);
  }
  std::vector<TilesetWriter::Square> result;
  for (auto& [order, square] : squares) result.push_back(std::move(square));
  return result;
}

constexpr int kSquares = 16;
const TilesetBounds kTown{{-100.0, -100.0, -2.0}, {104.6, 104.6, 10.2}, 0.2};

Status write_town(const fs::path& folder, std::size_t at_once, const std::vector<TilesetWriter::Square>& squares) {
  TilesetWriter writer(folder, kTown);
  for (std::size_t i = 0; i < squares.size(); i += at_once)
    if (const Status status = writer.add(std::span(squares).subspan(i, std::min(at_once, squares.size() - i))); !status)
      return status;
  return writer.finish();
}

std::map<std::string, std::string> files_of(const fs::path& folder) {
  std::map<std::string, std::string> files;
  for (const auto& entry : fs::directory_iterator(folder)) files[entry.path().filename()] = bytes_of(entry.path());
  return files;
}

using Voxel = std::tuple<int, int, int>;
Voxel voxel_of(const MapPoint& p, double edge_m) {
  return {static_cast<int>(std::floor((p.x + 100.0) / edge_m)), static_cast<int>(std::floor((p.y + 100.0) / edge_m)),
          static_cast<int>(std::floor((p.z + 2.0) / edge_m))};
}

TEST(TilesetWriter, EveryPointStandsInOneTileWithItsLabels) {
  const fs::path folder = tileset_folder("once");
  const auto squares = town();
  ASSERT_EQ(squares.size(), std::size_t{kSquares});
  ASSERT_TRUE(write_town(folder, 3, squares));
  std::vector<MapPoint> written, expected;
  for (const auto& entry : fs::directory_iterator(folder))
    if (entry.path().extension() == ".glb")
      for (const MapPoint& p : read_glb(entry.path())) written.push_back(p);
  for (const auto& square : squares) expected.insert(expected.end(), square.points.begin(), square.points.end());
  ASSERT_EQ(written.size(), expected.size());
  // Positions are to 204.8 m / 65535 / 2 = 1.6 mm: each point is in its bin of 1 cm or the next.
  const auto bin_of = [](const MapPoint& p) {
    const auto of = [](float v) { return static_cast<int>(std::floor(v / 0.01f)); };
    return std::array{of(p.x), of(p.y), of(p.z), static_cast<int>(p.intensity), int{p.session}, int{p.time}};
  };
  std::set<std::array<int, 6>> bins;
  for (const MapPoint& p : written) bins.insert(bin_of(p));
  for (std::size_t i = 0; i < expected.size(); i += 97) {
    const auto bin = bin_of(expected[i]);
    bool is_there = false;
    for (int k = 0; k < 27; ++k)
      is_there = is_there || bins.contains({bin[0] + k % 3 - 1, bin[1] + k / 3 % 3 - 1, bin[2] + k / 9 - 1, bin[3],
                                            bin[4], bin[5]});
    ASSERT_TRUE(is_there) << i;
  }
}

TEST(TilesetWriter, TheRootShowsTheWholeTownCoarsely) {
  const fs::path folder = tileset_folder("root");
  ASSERT_TRUE(write_town(folder, 16, town()));
  const auto root = read_glb(folder / "0_0_0_0.glb");
  constexpr double kSpacing_m = 256.0 * 0.8 / 128.0;  // 204.8 m: 1024 cells
  std::set<Voxel> voxels;
  for (const MapPoint& p : root) voxels.insert(voxel_of(p, kSpacing_m));
  EXPECT_GT(root.size(), 128u * 128u) << "all of the ground";
  EXPECT_LT(root.size(), 128u * 128u + 3000u) << "and a wall of 8 rows";
  EXPECT_GT(static_cast<double>(voxels.size()), 0.98 * static_cast<double>(root.size())) << "one point a voxel";
}

TEST(TilesetWriter, WritesTheSameBytesForAnyNumberOfThreadsAndParts) {
  const auto squares = town();
  const fs::path one = tileset_folder("one"), two = tileset_folder("two");
  ASSERT_TRUE(tbb::task_arena(1).execute([&] { return write_town(one, 1, squares); }));
  ASSERT_TRUE(tbb::task_arena(4).execute([&] { return write_town(two, 7, squares); }));
  EXPECT_GT(files_of(one).size(), 10u);
  EXPECT_TRUE(files_of(one) == files_of(two));
}

TEST(TilesetWriter, BoxesHoldThePointsAndTheChildren) {
  const fs::path folder = tileset_folder("boxes");
  ASSERT_TRUE(write_town(folder, 16, town()));
  const std::string json = bytes_of(folder / "tileset.json");
  EXPECT_NE(json.find("\"version\":\"1.1\""), std::string::npos);
  std::size_t tiles = 0;
  for (std::size_t at = json.find("\"uri\":\""); at != std::string::npos; at = json.find("\"uri\":\"", at + 1)) {
    const std::string name = json.substr(at + 7, json.find('"', at + 7) - at - 7);
    const std::size_t box_at = json.rfind("\"box\":[", at);
    const auto box = numbers_after(json.substr(box_at), "\"box\":[", 12);
    for (const MapPoint& p : read_glb(folder / name)) {
      ASSERT_LE(std::abs(p.x - box[0]), box[3]) << name;
      ASSERT_LE(std::abs(p.y - box[1]), box[7]) << name;
      ASSERT_LE(std::abs(p.z - box[2]), box[11]) << name;
    }
    ++tiles;
  }
  EXPECT_EQ(tiles + 1, files_of(folder).size()) << "each file is named once";
}

TEST(TilesetWriter, OfNothingIsATilesetWithoutTiles) {
  const fs::path folder = tileset_folder("nothing");
  TilesetWriter writer(folder, {});
  ASSERT_TRUE(writer.finish());
  EXPECT_EQ(files_of(folder).size(), 1u);
}

TEST(TilesetWriter, NamesTheFileThatCannotBeWritten) {
  const fs::path folder = tileset_folder("full");
  fs::remove_all(folder);
  const Status status = write_town(folder, 16, town());
  ASSERT_FALSE(status);
  EXPECT_NE(status.error().message.find(".glb: cannot be written"), std::string::npos) << status.error().message;
}

TEST(SplitSquare, FewPointsStandInOneNode) {
  const Octree octree{.square_bits = 8, .root_bits = 8};
  std::vector<MapPoint> points(100);
  for (std::size_t i = 0; i < points.size(); ++i) points[i].x = 0.5f * static_cast<float>(i);
  int nodes = 0;
  split_square(octree, 0, 0, points, [&](const OctreeNode& node, std::span<const MapPoint> own) {
    ++nodes;
    EXPECT_EQ(own.size(), 100u);
    EXPECT_EQ(node.bits, 8);
  });
  EXPECT_EQ(nodes, 1);
}

// Rounding puts x = 256 m, the border of two squares from -460.8 m on, into another cell than square.
TEST(BuildMap, PointsOnBordersOfSquaresAreKept) {
  const fs::path folder = tileset_folder("borders");
  std::vector<Point> points;
  for (int i = -9; i <= 20; ++i) points.push_back({static_cast<float>(51.2 * i), 1.f, 0.f, 0.5f});
  for (const float x : {256.f, 512.f, 768.f}) {
    points.push_back({x, 20.f, 0.f, 0.5f});
    points.push_back({x - 1.f, 20.f, 0.f, 0.5f});
    points.push_back({x + 1.f, 20.f, 0.f, 0.5f});
  }
  const MapInput input{{Pose::Identity()}, [&](std::size_t) -> Result<std::vector<Point>> { return points; }, {}};
  const auto report = build_map(input, {}, folder);
  ASSERT_TRUE(report) << report.error().message;
  std::size_t written = 0;
  for (const auto& entry : fs::directory_iterator(folder / "tiles"))
    if (entry.path().extension() == ".glb") written += read_glb(entry.path()).size();
  EXPECT_EQ(written, points.size());
}

TEST(BuildMap, LabelsPointsWithSessionAndTime) {
  const fs::path folder = tileset_folder("labels");
  const MapInput input{{planar_pose(0, 0, 0), planar_pose(300, 0, 0)},
                       [](std::size_t) -> Result<std::vector<Point>> {
                         return std::vector<Point>{{1, 1, 0, 0.5f}};
                       },
                       {0, 3}};
  const auto report = build_map(input, {}, folder);
  ASSERT_TRUE(report) << report.error().message;
  EXPECT_EQ(report->points, 2u);
  std::map<int, MapPoint> by_session;
  for (const auto& entry : fs::directory_iterator(folder / "tiles")) {
    EXPECT_TRUE(entry.path().extension() == ".glb" || entry.path().filename() == "tileset.json") << entry.path();
    if (entry.path().extension() == ".glb")
      for (const MapPoint& p : read_glb(entry.path())) by_session[p.session] = p;
  }
  ASSERT_EQ(by_session.size(), 2u);
  EXPECT_NEAR(by_session[0].x, 1.f, 0.01f);
  EXPECT_NEAR(by_session[3].x, 301.f, 0.01f);
  EXPECT_NEAR(by_session[3].y, 1.f, 0.01f);
  EXPECT_EQ(by_session[3].time, 65535);
}

}  // namespace
}  // namespace revisit
