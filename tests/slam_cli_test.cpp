// SPDX-License-Identifier: Apache-2.0
// Trajectory and map as a user of the program meets them.
#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <thread>

#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <revisit/io/pose_file.hpp>
#include <revisit/io/scan_file.hpp>
#include <revisit/store/map_store.hpp>

#include "run_program.hpp"
#include "shared_data.hpp"

namespace revisit {
namespace {

namespace fs = std::filesystem;
using testing_support::fresh_folder;
using testing_support::run;

fs::path small_drive(const fs::path& folder) {
  const fs::path file = folder / "drive.toml";
  std::ofstream(file) << "[simulation]\nsensor = \"vlp16\"\nlength_m = 50\nframes = 40\n";
  return file;
}

TEST(SlamCli, WritesTrajectoryMapAndGraph) {
  const fs::path folder = fresh_folder(), drive = small_drive(folder), out = folder / "out";
  const auto outcome = run("slam " + drive.string() + " --out " + out.string());
  ASSERT_EQ(outcome.code, 0) << outcome.output;
  EXPECT_NE(outcome.output.find("40 scans"), std::string::npos) << outcome.output;
  for (const char* name : {"poses.txt", "poses.tum", "odometry.tum", "graph.g2o"}) {
    const auto poses = read_poses(out / name);
    ASSERT_TRUE(poses) << poses.error().message;
    EXPECT_GE(poses->rows.size(), 10u) << name;
  }
  EXPECT_EQ(read_poses(out / "poses.tum")->rows.size(), 40u);
  const auto ply = read_scan(out / "map.ply"), pcd = read_scan(out / "map.pcd");
  ASSERT_TRUE(ply && pcd);
  EXPECT_GT(ply->points.size(), 1000u);
  ASSERT_EQ(ply->points.size(), pcd->points.size());
  EXPECT_EQ(ply->points[500].x, pcd->points[500].x);
  EXPECT_EQ(ply->points[500].intensity, pcd->points[500].intensity);
  for (const char* name :
       {"map.png", "tiles/tileset.json", "run.json", "loops.csv", "candidates.csv", "evidence.csv", "map.revisit"})
    EXPECT_TRUE(fs::exists(out / name)) << name;

  const auto evaluated = run("evaluate " + out.string() + " --reference " + drive.string());
  ASSERT_EQ(evaluated.code, 0) << evaluated.output;
  EXPECT_NE(evaluated.output.find("Table 3, trajectory"), std::string::npos);
  EXPECT_TRUE(fs::exists(out / "trajectories.png"));
  EXPECT_EQ(read_poses(out / "reference.txt")->rows.size(), 40u);

  const auto viewed = run("view " + out.string() + " --report " + (out / "view.html").string());
  if (viewed.output.find("built without the page") == std::string::npos) {
    ASSERT_EQ(viewed.code, 0) << viewed.output;
    EXPECT_GT(fs::file_size(out / "view.html"), 100'000u);
  }

  const auto again = run("slam " + drive.string() + " --out " + out.string());
  EXPECT_EQ(again.code, 1);
  EXPECT_NE(again.output.find("--resume"), std::string::npos) << again.output;
  const fs::path other = folder / "other.toml";
  std::ofstream(other) << "[simulation]\nsensor = \"vlp16\"\nlength_m = 50\nframes = 5\n";
  const auto mixed = run("slam " + other.string() + " --resume --out " + out.string());
  EXPECT_EQ(mixed.code, 1);
  EXPECT_NE(mixed.output.find("was made with the recording"), std::string::npos) << mixed.output;
}

// The program is killed while it works, and goes on from what it had committed.
TEST(SlamCli, GoesOnAfterAKill) {
  const fs::path folder = fresh_folder(), drive = small_drive(folder), out = folder / "out";
  const pid_t child = fork();
  if (child == 0) {
    const int quiet = ::open("/dev/null", O_WRONLY);
    ::dup2(quiet, 1);
    ::dup2(quiet, 2);
    ::execl(REVISIT_PROGRAM, REVISIT_PROGRAM, "slam", drive.c_str(), "--checkpoint-s", "0", "--out", out.c_str(),
            nullptr);
    ::_exit(127);
  }
  // As soon as some key frames are there.
  const auto has_some = [&] {
    const auto store = MapStore::open(out / "map.revisit", MapStore::Access::kRead);
    const auto keyframes = store ? store->keyframes() : Result<std::vector<StoredKeyframe>>(store.error());
    return keyframes && keyframes->size() > 2;
  };
  int how = 0;
  while (!has_some() && ::waitpid(child, &how, WNOHANG) == 0) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  ::kill(child, SIGKILL);
  ::waitpid(child, &how, 0);
  EXPECT_FALSE(fs::exists(out / "poses.tum")) << "it was still at work";

  const auto outcome = run("slam " + drive.string() + " --resume --out " + out.string());
  ASSERT_EQ(outcome.code, 0) << outcome.output;
  EXPECT_NE(outcome.output.find("going on after frame"), std::string::npos) << outcome.output;
  EXPECT_EQ(read_poses(out / "poses.tum")->rows.size(), 40u);
}

// Longer than rounding needs to grow where poses are made from poses and never normalised.
TEST(SlamCli, TakesTheOdometryOfALongRecording) {
  const fs::path folder = fresh_folder(), drive = folder / "drive";
  const auto simulated = run("simulate --sensor vlp16 --frames 120 --length_m 100 --out " + drive.string());
  ASSERT_EQ(simulated.code, 0) << simulated.output;
  const auto outcome = run("slam " + drive.string() + " --no-map --odometry " + (drive / "odometry.tum").string() +
                           " --poses " + (drive / "poses.txt").string() + " --out " + (folder / "out").string());
  EXPECT_EQ(outcome.code, 0) << outcome.output;
  EXPECT_NE(outcome.output.find("120 scans"), std::string::npos) << outcome.output;
}

TEST(SlamCli, NamesTheScansItDidNotTrack) {
  const fs::path folder = fresh_folder(), drive = folder / "drive";
  ASSERT_EQ(run("simulate --sensor vlp16 --frames 30 --length_m 50 --out " + drive.string()).code, 0);
  std::ifstream all(drive / "odometry.tum");
  std::ofstream some(folder / "some.tum");
  int row = 0;
  for (std::string line; std::getline(all, line); ++row)
    if (row < 10 || row > 12) some << line << '\n';
  some.close();
  const auto outcome = run("slam " + drive.string() + " --no-map --odometry " + (folder / "some.tum").string() +
                           " --out " + (folder / "out").string());
  EXPECT_EQ(outcome.code, 3) << outcome.output;
  EXPECT_NE(outcome.output.find("not tracked: frames "), std::string::npos) << outcome.output;
  EXPECT_NE(run("--help").output.find("not tracked"), std::string::npos);
}

TEST(SlamCli, SaysWhatItCannotDo) {
  const fs::path folder = fresh_folder(), drive = small_drive(folder);
  const std::string out = " --out " + (folder / "x").string();
  const auto both = run("slam " + drive.string() + out + " --wheels a.tum --odometry b.tum");
  EXPECT_EQ(both.code, 2);
  EXPECT_NE(both.output.find("name one"), std::string::npos);
  EXPECT_NE(run("slam " + drive.string() + out + " --wheels nowhere.tum").output.find("nowhere.tum"),
            std::string::npos);
  EXPECT_EQ(run("slam nowhere" + out).code, 1);
  fs::create_directories(folder / "x");
  std::ofstream(folder / "x" / "map.revisit") << "this is no map";
  const auto damaged = run("slam " + drive.string() + out + " --resume");
  EXPECT_EQ(damaged.code, 1);
  EXPECT_NE(damaged.output.find("map.revisit"), std::string::npos) << damaged.output;
}

}  // namespace
}  // namespace revisit
