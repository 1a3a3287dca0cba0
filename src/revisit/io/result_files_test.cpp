// SPDX-License-Identifier: Apache-2.0
#include <revisit/io/result_files.hpp>

#include <fstream>
#include <sstream>

#include <revisit/io/calibration_file.hpp>

#include "shared_data.hpp"

namespace revisit {
namespace {

namespace fs = std::filesystem;
using testing_support::fresh_folder;

std::string content(const fs::path& file) {
  std::stringstream text;
  text << std::ifstream(file).rdbuf();
  return text.str();
}

TEST(ResultFiles, RowsAreCompleteAsSoonAsTheyAreAdded) {
  const fs::path folder = fresh_folder() / "new" / "folder";
  auto writer = ResultWriter::create(folder, ResultWriter::Existing::kRefuse);
  ASSERT_TRUE(writer) << writer.error().message;
  ASSERT_TRUE(writer->add(CandidateRow{FrameId{70}, FrameId{3}, 0.75, false, "a, b"}));
  ASSERT_TRUE(writer->add(CandidateRow{FrameId{71}, std::nullopt, 0.0, false, "no place like it"}));
  LoopConstraint loop;
  loop.query = FrameId{70};
  loop.match = FrameId{3};
  loop.T_match_query.translation() << 1.0, 2.0, 3.0;
  loop.score = 1.5;
  ASSERT_TRUE(writer->add(loop));
  EXPECT_EQ(content(folder / "candidates.csv"),
            "query,match,score,accepted,reason\n70,3,0.75,0,a; b\n71,,0,0,no place like it\n");
  EXPECT_EQ(content(folder / "loops.csv"),
            "query,match,score,tx,ty,tz,qx,qy,qz,qw,inlier_ratio,rmse_m\n70,3,1.5,1,2,3,0,0,0,1,0,0\n");
  const auto candidates = read_candidates(folder / "candidates.csv");
  ASSERT_TRUE(candidates) << candidates.error().message;
  EXPECT_EQ((*candidates)[0].match->value, 3);
  EXPECT_FALSE((*candidates)[1].match);
  const auto loops = read_loops(folder / "loops.csv");
  ASSERT_TRUE(loops) << loops.error().message;
  EXPECT_DOUBLE_EQ((*loops)[0].T_match_query.translation().z(), 3.0);
}

TEST(ResultFiles, ExistingResultsAreKept) {
  const fs::path folder = fresh_folder();
  ASSERT_TRUE(ResultWriter::create(folder, ResultWriter::Existing::kRefuse));
  const auto second = ResultWriter::create(folder, ResultWriter::Existing::kRefuse);
  ASSERT_FALSE(second);
  EXPECT_NE(second.error().message.find("--overwrite"), std::string::npos);
  std::ofstream(folder / "poses.txt") << "of an earlier run";
  std::ofstream(folder / "notes.txt") << "of the user";
  EXPECT_TRUE(ResultWriter::create(folder, ResultWriter::Existing::kReplace));
  EXPECT_FALSE(fs::exists(folder / "poses.txt"));
  EXPECT_TRUE(fs::exists(folder / "notes.txt"));
}

TEST(ResultFiles, WhatIsKnownLaterStandsInTheRowOfItsQuery) {
  const fs::path folder = fresh_folder();
  auto writer = ResultWriter::create(folder, ResultWriter::Existing::kReplace);
  ASSERT_TRUE(writer) << writer.error().message;
  for (const int query : {100, 101, 102}) {
    ASSERT_TRUE(writer->add(CandidateRow{{query}, FrameId{7}, 0.5, query == 102, "not sure"}));
    if (query == 102) {
      ASSERT_TRUE(writer->add(LoopConstraint{{102}, {8}}));
    }
  }
  writer->replace(CandidateRow{{101}, FrameId{9}, 1.5, true, ""});
  ASSERT_TRUE(writer->add(LoopConstraint{{101}, {9}}));
  EXPECT_EQ(read_candidates(folder / "candidates.csv")->at(1).match, FrameId{7}) << "until the end, as it was decided";
  ASSERT_TRUE(writer->finish());
  const auto rows = read_candidates(folder / "candidates.csv");
  ASSERT_TRUE(rows && rows->size() == 3);
  EXPECT_EQ((*rows)[0].reason, "not sure");
  EXPECT_EQ((*rows)[1].query, FrameId{101});
  EXPECT_EQ((*rows)[1].match, FrameId{9});
  EXPECT_TRUE((*rows)[1].accepted);
  const auto loops = read_loops(folder / "loops.csv");
  ASSERT_TRUE(loops && loops->size() == 2);
  EXPECT_EQ((*loops)[0].match, FrameId{9}) << "in the order of the queries";
  EXPECT_EQ((*loops)[1].match, FrameId{8});
}

TEST(ResultFiles, AFullDiskIsNoticed) {
  if (!fs::exists("/dev/full")) GTEST_SKIP() << "needs /dev/full";
  const fs::path folder = fresh_folder();
  fs::create_symlink("/dev/full", folder / "candidates.csv");
  const auto writer = ResultWriter::create(folder, ResultWriter::Existing::kReplace);
  ASSERT_FALSE(writer);
  EXPECT_NE(writer.error().message.find("candidates.csv: cannot be written: No space left"), std::string::npos)
      << writer.error().message;
}

TEST(ResultFiles, ForeignRowsAreRefusedByLine) {
  const fs::path file = fresh_folder() / "candidates.csv";
  for (const char* row : {"1,2", "a,2,0.5,1,", "1,2,nan,1,", "1,2,0.5,yes,", "1.5,2,0.5,1,", "-1,2,0.5,1,"}) {
    std::ofstream(file, std::ios::trunc) << "query,match,score,accepted,reason\n" << row << "\n";
    const auto rows = read_candidates(file);
    ASSERT_FALSE(rows) << row;
    EXPECT_NE(rows.error().message.find(":2:"), std::string::npos);
  }
}

TEST(CalibrationFile, ReadsBackAndRefusesNonsense) {
  const fs::path file = fresh_folder() / "phi.json";
  const IntensityCalibration calibration{{5.0, 10.0}, {0.9, 1.2}, {1.0, 0.8, 1.1}};
  ASSERT_TRUE(write_calibration(file, calibration));
  const auto again = read_calibration(file);
  ASSERT_TRUE(again) << again.error().message;
  EXPECT_EQ(again->distance_gains, calibration.distance_gains);
  EXPECT_EQ(again->ring_gains, calibration.ring_gains);
  for (
      const char* text :
      {"", "[]", "{}", R"({"format":"revisit intensity calibration","version":2})",
       R"({"format":"revisit intensity calibration","version":1,"distance_knots_m":[2,1],"distance_gains":[1,1],"ring_gains":[]})",
       R"({"format":"revisit intensity calibration","version":1,"distance_knots_m":[1],"distance_gains":[-1],"ring_gains":[]})"}) {
    std::ofstream(file, std::ios::trunc) << text;
    EXPECT_FALSE(read_calibration(file)) << text;
  }
}

TEST(LocalisationFile, GivesBackWhatItWasGiven) {
  const fs::path file = fresh_folder() / "localisation.csv";
  LocalisationRow found;
  found.frame = {7};
  found.status = "followed";
  found.match = in_map(3, {12});
  found.T_map_lidar = planar_pose(1.25, -2.5, 0.5);
  found.T_match_lidar = planar_pose(0.5, 0.25, -0.125);
  found.probability = 0.998;
  found.deviation_m = 0.01;
  found.deviation_deg = 0.02;
  found.ms = 12.5;
  LocalisationRow lost;
  lost.frame = {8};
  lost.status = "lost";
  lost.reason = "probability 0.2, too low";
  {
    LocalisationWriter writer(file);
    ASSERT_TRUE(writer.add(found) && writer.add(lost) && writer.finish());
  }
  const auto rows = read_localisation(file);
  ASSERT_TRUE(rows) << rows.error().message;
  ASSERT_EQ(rows->size(), 2u);
  EXPECT_EQ((*rows)[0].match, in_map(3, {12}));
  EXPECT_TRUE((*rows)[0].T_map_lidar.isApprox(found.T_map_lidar, 1e-8));
  EXPECT_TRUE((*rows)[0].T_match_lidar.isApprox(found.T_match_lidar, 1e-8));
  EXPECT_EQ((*rows)[0].deviation_m, 0.01);
  EXPECT_EQ((*rows)[0].ms, 12.5);
  EXPECT_FALSE((*rows)[1].is_answered());
  EXPECT_EQ((*rows)[1].reason, "probability 0.2; too low") << "no comma in a cell";
  std::ofstream(file, std::ios::app) << "9,found,0,x\n";
  EXPECT_FALSE(read_localisation(file));
}

}  // namespace
}  // namespace revisit
