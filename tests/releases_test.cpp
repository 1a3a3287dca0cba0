// SPDX-License-Identifier: Apache-2.0
// What earlier releases wrote is read (tests/data, a folder a release): maps, results, calibrations, parameters.
#include <algorithm>
#include <filesystem>

#include <gtest/gtest.h>

#include <revisit/config/parameter_file.hpp>
#include <revisit/io/calibration_file.hpp>
#include <revisit/io/pose_file.hpp>
#include <revisit/io/result_files.hpp>

#include "run_program.hpp"
#include "shared_data.hpp"
#include "source_dir.hpp"

namespace revisit {
namespace {

namespace fs = std::filesystem;
using testing_support::run;
using testing_support::run_program;

TEST(Releases, FilesOfEarlierOnesAreRead) {
  const fs::path work = testing_support::fresh_folder(), map = work / "map.revisit";
  int releases = 0;
  for (const auto& release : fs::directory_iterator(testing_support::source_dir() / "tests/data")) {
    const fs::path& folder = release.path();
    SCOPED_TRACE(folder.string());
    ++releases;
    ASSERT_EQ(run_program("gunzip -c " + (folder / "map.revisit.gz").string() + " > " + map.string()).code, 0);
    const auto checked = run("info --check " + map.string());
    EXPECT_EQ(checked.code, 0) << checked.output;
    EXPECT_NE(checked.output.find("Every row is what was written"), std::string::npos) << checked.output;
    const auto exported = run("export " + map.string() + " --as tum --out " + work.string());
    EXPECT_EQ(exported.code, 0) << exported.output;
    const auto before = read_poses(folder / "poses.tum"), now = read_poses(work / "session_0.tum");
    ASSERT_TRUE(before && now);
    ASSERT_EQ(before->rows.size(), now->rows.size());
    EXPECT_TRUE(before->rows.back().T_world_body.isApprox(now->rows.back().T_world_body, 1e-9));

    const auto loops = read_loops(folder / "loops.csv");
    ASSERT_TRUE(loops) << loops.error().message;
    EXPECT_EQ(loops->size(), 3u);
    const auto candidates = read_candidates(folder / "candidates.csv");
    ASSERT_TRUE(candidates) << candidates.error().message;
    EXPECT_EQ(candidates->size(), 3u);
    const auto localised = read_localisation(folder / "localisation.csv");
    ASSERT_TRUE(localised) << localised.error().message;
    EXPECT_EQ(localised->size(), 3u);
    EXPECT_TRUE(read_calibration(folder / "calibration.json"));
    const auto parameters = read_parameters(folder / "parameters.toml");
    EXPECT_TRUE(parameters) << parameters.error().message;
  }
  EXPECT_GT(releases, 0);
}

}  // namespace
}  // namespace revisit
