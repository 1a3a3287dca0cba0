// SPDX-License-Identifier: Apache-2.0
// Each example is run, and is as short as it claims to be.
#include <filesystem>
#include <fstream>

#include <gtest/gtest.h>

#include <revisit/io/recording.hpp>

#include "run_program.hpp"
#include "shared_data.hpp"
#include "source_dir.hpp"
#include "synthetic_world.hpp"

namespace revisit {
namespace {

namespace fs = std::filesystem;
using testing_support::fresh_folder;
using testing_support::Outcome;
using testing_support::SyntheticWorld;

Outcome example(const std::string& name, const std::string& arguments) {
  return testing_support::run_program(std::string(REVISIT_EXAMPLES) + "/example_" + name + " " + arguments);
}

// Out and back along a street: 120 scans, the last of them where the first were.
fs::path small_recording(const fs::path& folder) {
  const SyntheticWorld world(51);
  std::ofstream times(folder / "times.txt");
  for (int i = 0; i < 120; ++i) {
    const double x = i < 60 ? 0.5 * i : 0.5 * (119 - i);
    Scan scan = world.scan(SyntheticWorld::at(x, 0, 0), {32, 450, -24.8, 5.0}, static_cast<unsigned>(i));
    scan.frame = FrameId{i};
    EXPECT_TRUE(write_kitti_scan(folder, scan));
    times << 0.5 * i << '\n';
  }
  return folder;
}

std::string scan_file(const fs::path& recording, int frame) {
  char name[32];
  std::snprintf(name, sizeof name, "%06d.bin", frame);
  return (recording / "velodyne" / name).string();
}

TEST(Examples, TheFourDoors) {
  const fs::path folder = fresh_folder(), recording = small_recording(folder);
  const Outcome loops = example("loop_detector", recording.string());
  EXPECT_EQ(loops.code, 0) << loops.output;
  EXPECT_NE(loops.output.find("119 -> 0:"), std::string::npos) << loops.output;

  const Outcome registered = example("register_scans", scan_file(recording, 6) + " " + scan_file(recording, 0));
  EXPECT_EQ(registered.code, 0);
  EXPECT_NE(registered.output.find("the source stands at (3.0"), std::string::npos) << registered.output;

  const fs::path map = folder / "map";
  const Outcome slam = testing_support::run_program("cd " + folder.string() + " && " REVISIT_EXAMPLES "/example_slam " +
                                                    recording.string() + " " + map.string());
  EXPECT_EQ(slam.code, 0) << slam.output;
  EXPECT_NE(slam.output.find("120 poses, "), std::string::npos) << slam.output;

  const Outcome found = example("localiser", map.string() + " " + scan_file(recording, 20));
  EXPECT_EQ(found.code, 0);
  EXPECT_NE(found.output.find("at (10.0"), std::string::npos) << found.output;
}

TEST(Examples, EachStageByItselfIsTheShippedMethod) {
  const fs::path folder = fresh_folder(), recording = small_recording(folder);
  for (const int later : {3, 9, 113}) {
    const Outcome stages = example("each_stage", scan_file(recording, 0) + " " + scan_file(recording, later));
    EXPECT_EQ(stages.code, 0) << stages.output;
    EXPECT_NE(stages.output.find("a loop\nregister_scans() says the same"), std::string::npos) << stages.output;
  }
}

TEST(Examples, EachDoorTakesAtMostFifteenLines) {
  for (const char* name : {"loop_detector", "register_scans", "slam", "localiser"}) {
    std::ifstream file(testing_support::source_dir() / "examples" / (std::string(name) + ".cpp"));
    int lines = 0;
    bool is_inside = false;
    for (std::string line; std::getline(file, line);) {
      if (line == "}") is_inside = false;
      lines += is_inside;
      if (line.starts_with("int main")) is_inside = true;
    }
    EXPECT_GT(lines, 5) << name;
    EXPECT_LE(lines, 15) << name;
  }
}

}  // namespace
}  // namespace revisit
