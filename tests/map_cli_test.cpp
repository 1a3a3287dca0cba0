// SPDX-License-Identifier: Apache-2.0
// A saved map as a user of the program meets it: woken up in, followed, added to, merged, exported, killed.
#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <thread>

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <revisit/io/pose_file.hpp>
#include <revisit/io/result_files.hpp>
#include <revisit/io/scan_file.hpp>
#include <revisit/store/map_store.hpp>

#include "run_program.hpp"
#include "shared_data.hpp"

namespace revisit {
namespace {

namespace fs = std::filesystem;
using testing_support::fresh_folder;
using testing_support::run;

fs::path drive_of_day(const fs::path& folder, int day, const std::string& more = "") {
  fs::create_directories(folder);
  const fs::path file = folder / ("day" + std::to_string(day) + ".toml");
  std::ofstream(file) << "[simulation]\nsensor = \"vlp16\"\nlength_m = 45\nday = " << day << "\n" << more;
  return file;
}

// A map of 45 m, and the same road on the next day, driven the other way round. Only what a test needs is made.
struct Maps {
  fs::path folder = fresh_folder();
  fs::path day0, day1, map, map1;
  explicit Maps(bool both = false) {
    day0 = drive_of_day(folder, 0);
    day1 = drive_of_day(folder, 1, "beside_m = 0.7\nreverse = true\n");
    map = folder / "map";
    map1 = folder / "map1";
    for (const auto& [drive, out] : {std::pair{day0, map}, {day1, map1}}) {
      if (out == map1 && !both) continue;
      const auto made = run("slam " + drive.string() + " --no-map --out " + out.string());
      EXPECT_EQ(made.code, 0) << made.output;
    }
  }
};

// Of the head of a LAS file: x, y, z; largest x, least x, and so on.
constexpr std::size_t kLasOffsets = 155, kLasBounds = 179;
double number_of(const std::string& bytes, std::size_t at, int index) {
  double value = 0.0;
  bytes.copy(reinterpret_cast<char*>(&value), sizeof value, at + sizeof value * static_cast<std::size_t>(index));
  return value;
}

std::string bytes_of(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

TEST(MapCli, LocalisesARecordingAndIsScored) {
  const Maps maps;
  const fs::path out = maps.folder / "where";
  const auto found = run("localise " + maps.map.string() + " " + maps.day1.string() + " --out " + out.string());
  ASSERT_EQ(found.code, 0) << found.output;
  EXPECT_NE(found.output.find(" followed"), std::string::npos) << found.output;
  const auto rows = read_localisation(out / "localisation.csv");
  ASSERT_TRUE(rows) << rows.error().message;
  ASSERT_GT(rows->size(), 40u);
  EXPECT_EQ(rows->back().status, "followed");
  EXPECT_GT(rows->back().deviation_m, 0.0);
  EXPECT_GE(read_poses(out / "poses.tum")->rows.size(), rows->size() * 8 / 10);
  const auto scored = run("evaluate " + out.string() + " --reference " + maps.day1.string());
  ASSERT_EQ(scored.code, 0) << scored.output;
  EXPECT_NE(scored.output.find("Table 5"), std::string::npos) << scored.output;
  EXPECT_TRUE(fs::exists(out / "evaluation.json"));
  const auto without = run("localise " + maps.map.string() + " " + maps.day1.string());
  EXPECT_EQ(without.code, 2) << without.output;
}

TEST(MapCli, LocalisesOneScan) {
  const Maps maps;
  const fs::path folder = maps.folder, drive = folder / "drive";
  ASSERT_EQ(run("simulate --parameters " + maps.day1.string() + " --frames 3 --out " + drive.string()).code, 0);
  const auto found = run("localise " + maps.map.string() + " " + (drive / "velodyne" / "000001.bin").string());
  EXPECT_EQ(found.code, 0) << found.output;
  EXPECT_NE(found.output.find("m in the map"), std::string::npos) << found.output;
  const auto nowhere = run("localise " + (folder / "no.revisit").string() + " " + maps.day1.string() + " --out x");
  EXPECT_EQ(nowhere.code, 1);
  EXPECT_NE(nowhere.output.find("no such map"), std::string::npos) << nowhere.output;
}

TEST(MapCli, AddsASessionAndTellsOfIt) {
  const Maps maps;
  const fs::path folder = maps.folder, map = folder / "site.revisit", out = folder / "tuesday";
  fs::copy_file(maps.map / "map.revisit", map);
  const auto added = run("slam " + maps.day1.string() + " --no-map --into " + map.string() + " --out " + out.string());
  ASSERT_EQ(added.code, 0) << added.output;
  EXPECT_FALSE(fs::exists(out / "map.revisit")) << "the map is where it was";
  EXPECT_GT(read_poses(out / "poses.tum")->rows.size(), 40u);
  const auto info = run("info " + map.string() + " --check");
  ASSERT_EQ(info.code, 0) << info.output;
  EXPECT_NE(info.output.find("day1.toml"), std::string::npos) << info.output;
  EXPECT_NE(info.output.find("Every row is what was written"), std::string::npos) << info.output;
  const auto scored = run("evaluate " + map.string());
  ASSERT_EQ(scored.code, 0) << scored.output;
  EXPECT_NE(scored.output.find("2 of 2 sessions"), std::string::npos) << scored.output;
  EXPECT_NE(scored.output.find(" 0 wrong joins"), std::string::npos) << scored.output;
}

// By way of a bag, as a robot records it.
TEST(MapCli, GpsPlacesAMapOnTheEarth) {
  const fs::path folder = fresh_folder(), bag = folder / "drive.mcap", map = folder / "map", out = folder / "out";
  const fs::path drive = folder / "long.toml";
  std::ofstream(drive) << "[simulation]\nsensor = \"vlp16\"\nlength_m = 60\ngps = true\n";
  ASSERT_EQ(run("simulate --parameters " + drive.string() + " --out " + bag.string()).code, 0);
  EXPECT_NE(run("info " + bag.string()).output.find("/fix"), std::string::npos);
  const auto made = run("slam " + bag.string() + " --gps --out " + map.string());
  ASSERT_EQ(made.code, 0) << made.output;
  const auto info = run("info --check " + map.string());
  EXPECT_NE(info.output.find("UTM 32N (EPSG:32632)"), std::string::npos) << info.output;
  const auto exported = run("export " + map.string() + " --as tum --utm --out " + out.string());
  ASSERT_EQ(exported.code, 0) << exported.output;
  const auto poses = read_poses(out / "session_0.tum");
  ASSERT_TRUE(poses);
  // The simulated receiver is at 49 degrees north, 8.4 degrees east.
  const Eigen::Vector3d at = poses->rows.front().T_world_body.translation();
  EXPECT_NEAR(at.x(), 456114.6, 500.0);
  EXPECT_NEAR(at.y(), 5427629.2, 500.0);
  EXPECT_TRUE(fs::exists(out / "utm.json"));
  // The map of `slam` is where the exported one is, with the same zone and offset in its head.
  ASSERT_EQ(run("export " + map.string() + " --as las --utm --out " + out.string()).code, 0);
  const std::string own = bytes_of(map / "map.las"), other = bytes_of(out / "map.las");
  for (int axis = 0; axis < 3; ++axis) {
    EXPECT_EQ(number_of(own, kLasOffsets, axis), number_of(other, kLasOffsets, axis));
    for (const int side : {0, 1})
      EXPECT_NEAR(number_of(own, kLasBounds, 2 * axis + side), number_of(other, kLasBounds, 2 * axis + side), 0.5);
  }
  EXPECT_NEAR(number_of(own, kLasBounds, 0), 456114.6, 500.0);
  EXPECT_NE(own.find("32632"), std::string::npos);
  // What does not fit together is said.
  const std::string plain = drive_of_day(folder, 0).string();
  const auto without = run("slam " + plain + " --gps --no-map --out " + (folder / "without").string());
  EXPECT_NE(without.output.find("no GPS fix"), std::string::npos) << without.output;
  const Maps maps;
  const auto nowhere = run("export " + maps.map.string() + " --as tum --utm --out " + out.string());
  EXPECT_NE(nowhere.output.find("--gps"), std::string::npos) << nowhere.output;
}

TEST(MapCli, MergesAndExports) {
  const Maps maps(true);
  const fs::path folder = maps.folder, all = folder / "all.revisit";
  const auto merged = run("merge " + maps.map.string() + " " + maps.map1.string() + " --out " + all.string());
  ASSERT_EQ(merged.code, 0) << merged.output;
  const auto scored = run("evaluate " + all.string());
  EXPECT_NE(scored.output.find("2 of 2 sessions"), std::string::npos) << scored.output;
  for (const auto& [form, file] : {std::pair{"ply", "map.ply"},
                                   {"pcd", "map.pcd"},
                                   {"las", "map.las"},
                                   {"png", "map.png"},
                                   {"tiles", "tiles/tileset.json"},
                                   {"grid", "grid.yaml"},
                                   {"tum", "session_1.tum"},
                                   {"g2o", "graph.g2o"}}) {
    const fs::path out = folder / form;
    const auto exported = run("export " + all.string() + " --as " + form + " --out " + out.string());
    EXPECT_EQ(exported.code, 0) << exported.output;
    EXPECT_TRUE(fs::exists(out / file)) << file;
  }
  const auto ply = read_scan(folder / "ply" / "map.ply"), las = read_scan(folder / "las" / "map.las");
  ASSERT_TRUE(ply && las);
  EXPECT_EQ(ply->points.size(), las->points.size());
  EXPECT_NEAR(ply->points[100].x, las->points[100].x, 1e-3);
  const auto no_part = run("export " + all.string() + " --as ply --part 7 --out " + (folder / "x").string());
  EXPECT_EQ(no_part.code, 1);
  EXPECT_NE(no_part.output.find("no part 7"), std::string::npos) << no_part.output;
  const auto again = run("merge " + maps.map.string() + " --out " + all.string());
  EXPECT_EQ(again.code, 1) << "exists already";
}

// Starts the program and kills it once `is_time` says so.
template <typename IsTime>
void run_and_kill(const std::vector<std::string>& arguments, IsTime is_time) {
  const pid_t child = fork();
  if (child == 0) {
    const int quiet = ::open("/dev/null", O_WRONLY);
    ::dup2(quiet, 1);
    ::dup2(quiet, 2);
    std::vector<char*> argv{const_cast<char*>(REVISIT_PROGRAM)};
    for (const std::string& each : arguments) argv.push_back(const_cast<char*>(each.c_str()));
    argv.push_back(nullptr);
    ::execv(REVISIT_PROGRAM, argv.data());
    ::_exit(127);
  }
  int how = 0;
  while (!is_time() && ::waitpid(child, &how, WNOHANG) == 0) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  ::kill(child, SIGKILL);
  ::waitpid(child, &how, 0);
}

// Whatever is killed, whenever: the maps that were there are whole, and work goes on from them.
TEST(MapCli, AKillAtAnyMomentLeavesWholeMaps) {
  const Maps maps(true);
  const fs::path folder = maps.folder;
  for (const int after_ms : {20, 120, 250, 400, 700}) {
    const fs::path map = folder / ("into" + std::to_string(after_ms) + ".revisit"),
                   merged = folder / ("merged" + std::to_string(after_ms) + ".revisit");
    fs::copy_file(maps.map / "map.revisit", map);
    const auto passed = [after_ms, begin = std::chrono::steady_clock::now()]() mutable {
      return std::chrono::steady_clock::now() - begin > std::chrono::milliseconds(after_ms);
    };
    run_and_kill({"slam", maps.day1.string(), "--no-map", "--into", map.string(), "--out",
                  (folder / std::to_string(after_ms)).string()},
                 passed);
    const auto store = MapStore::open(map, MapStore::Access::kRead);
    ASSERT_TRUE(store) << after_ms << ": " << store.error().message;
    EXPECT_TRUE(store->check()) << after_ms;
    const auto sessions = store->sessions();
    ASSERT_TRUE(sessions);
    EXPECT_EQ(sessions->front().recording, fs::absolute(maps.day0).string());
    EXPECT_TRUE(MapStore::open(map)) << "and may be written to";

    run_and_kill({"merge", maps.map.string(), maps.map1.string(), "--out", merged.string()},
                 [after_ms, begin = std::chrono::steady_clock::now()] {
                   return std::chrono::steady_clock::now() - begin > std::chrono::milliseconds(after_ms);
                 });
    if (fs::exists(merged)) {
      const auto whole = MapStore::open(merged, MapStore::Access::kRead);
      ASSERT_TRUE(whole) << after_ms;
      EXPECT_EQ(whole->sessions()->size(), 2u);
    }
    for (const fs::path& source : {maps.map, maps.map1})
      EXPECT_TRUE(MapStore::open(source / "map.revisit", MapStore::Access::kRead)->check());
  }
}

}  // namespace
}  // namespace revisit
