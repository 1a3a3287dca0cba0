// SPDX-License-Identifier: Apache-2.0
// Simulated drives as a user of the program meets them.
#include <cmath>
#include <fstream>

#include <revisit/io/bag_writer.hpp>
#include <revisit/io/recording.hpp>

#include "run_program.hpp"
#include "shared_data.hpp"

namespace revisit {
namespace {

namespace fs = std::filesystem;
using testing_support::fresh_folder;
using testing_support::run;

TEST(SimulateCli, ADriveIsWrittenAndSimulatedAgainFromItsOwnFile) {
  const fs::path folder = fresh_folder(), drive = folder / "drive";
  const auto written = run("simulate --out " + drive.string() + " --sensor vlp16 --length_m 50 --frames 20");
  ASSERT_EQ(written.code, 0) << written.output;
  EXPECT_NE(written.output.find("20 scans of a simulated town, Velodyne VLP-16, seed 1"), std::string::npos);
  const std::string detect = " --retrieval.exclude_frames 5 --retrieval.exclude_s 0.5 --out ";
  ASSERT_EQ(run("detect " + drive.string() + detect + (folder / "a").string()).code, 0);
  const auto streamed = run("detect " + (drive / "simulation.toml").string() + detect + (folder / "b").string());
  ASSERT_EQ(streamed.code, 0) << streamed.output;
  const auto content = [](const fs::path& file) {
    std::ifstream stream(file);
    return std::string(std::istreambuf_iterator<char>(stream), {});
  };
  EXPECT_GT(content(folder / "a" / "loops.csv").size(), 500u);
  EXPECT_EQ(content(folder / "a" / "loops.csv"), content(folder / "b" / "loops.csv"));
  EXPECT_NE(content(folder / "b" / "run.json").find("\"simulation.sensor\": \"vlp16\""), std::string::npos);
  EXPECT_EQ(content(folder / "a" / "run.json").find("simulation."), std::string::npos);

  const auto evaluated =
      run("evaluate " + (folder / "b").string() + " --reference " + (drive / "simulation.toml").string());
  EXPECT_EQ(evaluated.code, 0) << evaluated.output;
  const auto again = run("simulate --out " + drive.string());
  EXPECT_EQ(again.code, 1);
  EXPECT_NE(again.output.find("holds something already; name a new or empty folder"), std::string::npos);
}

std::string content_of(const fs::path& file) {
  std::ifstream stream(file);
  return {std::istreambuf_iterator<char>(stream), {}};
}

TEST(SimulateCli, ABagAndAFolderOfOneDriveGiveTheSameLoopsToTheByte) {
  const fs::path folder = fresh_folder();
  const std::string drive = " --sensor vlp16 --length_m 50 --frames 20";
  const std::string detect = " --retrieval.exclude_frames 5 --retrieval.exclude_s 0.5 --out ";
  ASSERT_EQ(run("simulate --out " + (folder / "kitti").string() + drive).code, 0);
  ASSERT_EQ(run("detect " + (folder / "kitti").string() + detect + (folder / "from_kitti").string()).code, 0);
  const std::string expected = content_of(folder / "from_kitti" / "loops.csv");
  EXPECT_GT(expected.size(), 500u);
  for (const char* name : {"drive.bag", "drive.mcap", "drive.db3"}) {
    const fs::path bag = folder / name, results = folder / (std::string("from_") + name);
    const auto written = run("simulate --out " + bag.string() + drive);
    ASSERT_EQ(written.code, 0) << written.output;
    EXPECT_TRUE(fs::exists(bag.string() + ".poses.tum"));
    const auto found = run("detect " + bag.string() + detect + results.string());
    ASSERT_EQ(found.code, 0) << found.output;
    EXPECT_EQ(content_of(results / "loops.csv"), expected) << name;
    EXPECT_EQ(content_of(results / "candidates.csv"), content_of(folder / "from_kitti" / "candidates.csv")) << name;

    const fs::path back = folder / (bag.extension().string().substr(1) + "_again");
    const auto converted = run("convert " + bag.string() + " --out " + back.string());
    ASSERT_EQ(converted.code, 0) << converted.output;
    for (const char* file : {"velodyne/000007.bin", "velodyne_times/000007.bin", "velodyne_rings/000007.bin"})
      EXPECT_TRUE(content_of(back / file) == content_of(folder / "kitti" / file)) << name << " " << file;
    EXPECT_EQ(run("evaluate " + results.string() + " --reference " + bag.string() + ".poses.tum").code, 0);
  }
  EXPECT_NE(run("simulate --out " + (folder / "drive.bag").string() + drive).output.find("exists already"),
            std::string::npos);
}

TEST(SimulateCli, InfoListsTheTopicsOfABagAndWhatItFound) {
  const fs::path bag = fresh_folder() / "drive.mcap";
  ASSERT_EQ(run("simulate --out " + bag.string() + " --sensor vlp16 --length_m 50 --frames 10 --imu true").code, 0);
  const auto told = run("info " + bag.string());
  EXPECT_EQ(told.code, 0) << told.output;
  for (const char* text : {"/points", "sensor_msgs/PointCloud2", "10.0  scans", "IMU", "at the middle of the sweep",
                           "field 'time', s from the stamp", "VLP-16 or alike", "recorded 0.050 s after its stamp"})
    EXPECT_NE(told.output.find(text), std::string::npos) << text << "\n" << told.output;
  const auto slam = run("slam " + bag.string() + " --no-map --out " + (bag.parent_path() / "map").string());
  EXPECT_EQ(slam.code, 0) << slam.output;
  const auto wrong = run("detect " + bag.string() + " --topic /none --out " + (bag.parent_path() / "r").string());
  EXPECT_EQ(wrong.code, 1);
  EXPECT_NE(wrong.output.find("no topic '/none' of scans; there are: /points"), std::string::npos) << wrong.output;
}

TEST(SimulateCli, GapsAndDuplicatesOfABagAreToldAndSurvived) {
  const fs::path folder = fresh_folder();
  ASSERT_EQ(run("simulate --out " + (folder / "drive").string() + " --sensor vlp16 --length_m 50 --frames 12").code, 0);
  const auto drive = open_recording(folder / "drive");
  ASSERT_TRUE(drive);
  auto writer = BagWriter::create(folder / "odd.bag");
  ASSERT_TRUE(writer);
  for (const std::size_t i : {0u, 1u, 2u, 3u, 3u, 4u, 7u, 8u, 9u, 10u, 11u})
    ASSERT_TRUE(writer->write_scan("/points", "lidar", *(*drive)->read(i)));
  ASSERT_TRUE(writer->finish());
  const auto told = run("info " + (folder / "odd.bag").string());
  EXPECT_NE(told.output.find("1 among the first 11 scans, the longest 0.30 s"), std::string::npos) << told.output;
  EXPECT_NE(told.output.find("1 of the first 11 are not after the one before"), std::string::npos) << told.output;
  const auto slam = run("slam " + (folder / "odd.bag").string() + " --no-map --out " + (folder / "map").string());
  EXPECT_NE(slam.output.find("11 scans, "), std::string::npos) << slam.output;
  EXPECT_NE(slam.output.find("its stamp is not after that of the scan before"), std::string::npos) << slam.output;
}

TEST(SimulateCli, WrongNamesAreErrorsThatTellTheRightOnes) {
  const std::string out = " --out " + (fresh_folder() / "x").string();
  EXPECT_NE(
      run("simulate --sensor hdl32e" + out).output.find("allowed: hdl64e, vlp16, os0-128, rosette, os1-64, mid360"),
      std::string::npos);
  EXPECT_NE(run("simulate --world moon" + out).output.find("allowed: town, warehouse"), std::string::npos);
  EXPECT_NE(run("simulate --trajectory nowhere.txt" + out).output.find("nowhere.txt: cannot be opened"),
            std::string::npos);
  const auto lean = run("simulate --tilt_deg 80" + out);
  EXPECT_EQ(lean.code, 2);
  EXPECT_NE(lean.output.find("allowed: 0 to 40"), std::string::npos) << lean.output;
  EXPECT_FALSE(fs::exists(fresh_folder() / "x"));
}

TEST(SimulateCli, InfoKnowsADomeFromAScanWithoutRings) {
  const fs::path spec = fresh_folder() / "dome.toml";
  std::ofstream(spec) << "[simulation]\nsensor = \"mid360\"\nframes = 3\nlength_m = 100\n";
  const auto info = run("info " + spec.string());
  EXPECT_EQ(info.code, 0) << info.output;
  EXPECT_NE(info.output.find("Mid-360 or alike"), std::string::npos) << info.output;
}

TEST(SimulateCli, ParameterFilesQuoteTexts) {
  const fs::path file = fresh_folder() / "drive.toml";
  std::ofstream(file) << "[simulation]\nsensor = 16\n";
  const auto number = run("info " + file.string());
  EXPECT_EQ(number.code, 1);
  EXPECT_NE(number.output.find("simulation.sensor = 16 is not allowed; allowed: a text in quotes"), std::string::npos)
      << number.output;
  std::ofstream(file) << "[simulation]\nseed = \"1\"\n";
  EXPECT_NE(run("info " + file.string()).output.find("simulation.seed = '1' is not allowed"), std::string::npos);
}

TEST(SimulateCli, InfoComparesRecordingsAndDescribeDrawsAFrame) {
  const fs::path folder = fresh_folder(), file = folder / "drive.toml";
  std::ofstream(file) << "[simulation]\nsensor = \"vlp16\"\nlength_m = 50\nframes = 5\n";
  const auto compared =
      run("info " + file.string() + " --beside " + file.string() + " --picture " + (folder / "s.png").string());
  EXPECT_EQ(compared.code, 0) << compared.output;
  EXPECT_NE(compared.output.find("points a ring 1.00, range 1.00, intensity 1.00"), std::string::npos)
      << compared.output;
  EXPECT_GT(fs::file_size(folder / "s.png"), 1000u);
  const std::string picture = " --out " + (folder / "d.png").string();
  EXPECT_EQ(run("describe " + file.string() + " --frame 3" + picture).code, 0);
  EXPECT_NE(run("describe " + file.string() + " --frame 9" + picture).output.find("has no frame 9; allowed: 0 to 4"),
            std::string::npos);
  EXPECT_NE(run("describe " + file.string() + picture).output.find("name a scan of it with --frame"),
            std::string::npos);
}

// The mathematics library computes sines differently where it may fuse operations: no point moves by a millimetre.
TEST(SimulateCli, AnOlderProcessorSeesTheSameScan) {
  const fs::path folder = fresh_folder();
  const std::string options = " --length_m 50 --frames 2 --threads 1 --out ";
  ASSERT_EQ(run("simulate" + options + (folder / "new").string()).code, 0);
  ASSERT_EQ(
      run("simulate" + options + (folder / "old").string(), "GLIBC_TUNABLES=glibc.cpu.hwcaps=-AVX2,-FMA,-AVX512F,-FMA4")
          .code,
      0);
  const auto a = open_recording(folder / "new"), b = open_recording(folder / "old");
  ASSERT_TRUE(a && b);
  for (std::size_t i = 0; i < 2; ++i) {
    const Scan one = *(*a)->read(i), other = *(*b)->read(i);
    ASSERT_EQ(one.points.size(), other.points.size());
    for (std::size_t k = 0; k < one.points.size(); ++k) {
      const Point &p = one.points[k], &q = other.points[k];
      ASSERT_LT(std::hypot(p.x - q.x, p.y - q.y, p.z - q.z), 1e-3f);
    }
  }
}

}  // namespace
}  // namespace revisit
