// SPDX-License-Identifier: Apache-2.0
// The program as a user meets it: exit codes, messages, files, on good and on bad input.
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <limits>
#include <sstream>

#include <sys/wait.h>
#include <unistd.h>

#include <revisit/io/pose_file.hpp>
#include <revisit/io/result_files.hpp>

#include "run_program.hpp"
#include "shared_data.hpp"
#include "synthetic_world.hpp"

namespace revisit {
namespace {

namespace fs = std::filesystem;
using testing_support::fresh_folder;
using testing_support::Outcome;
using testing_support::run;
using testing_support::shared_data;
using testing_support::SyntheticWorld;

std::string content(const fs::path& file) {
  std::stringstream text;
  text << std::ifstream(file).rdbuf();
  return text.str();
}

void write_points(const fs::path& file, const std::vector<Point>& points) {
  std::ofstream(file, std::ios::binary)
      .write(reinterpret_cast<const char*>(points.data()), static_cast<std::streamsize>(points.size() * sizeof(Point)));
}

void write_scan(const fs::path& folder, int frame, const std::vector<Point>& points) {
  char name[32];
  std::snprintf(name, sizeof name, "%06d.bin", frame);
  write_points(folder / name, points);
}

std::vector<Point> scan_at(double x, double yaw_deg = 0.0) {
  static const SyntheticWorld world(71);
  return world.scan(SyntheticWorld::at(x, 0, to_radians(yaw_deg)), {32, 450, -24.8, 5.0}).points;
}

// A KITTI-like folder: out along x and back again, with poses in the LiDAR's own frame. 12 frames, one a second.
fs::path there_and_back(const fs::path& folder, double step_m = 4.0, double back_yaw_deg = 180.0) {
  fs::create_directories(folder / "velodyne");
  Trajectory trajectory;
  for (int i = 0; i < 12; ++i) {
    const double x = i < 6 ? step_m * i : step_m * (11 - i) + 0.5, yaw_deg = i < 6 ? 0.0 : back_yaw_deg;
    write_scan(folder / "velodyne", i, scan_at(x, yaw_deg));
    trajectory.entries[FrameId{i}] = {i * 1.0, SyntheticWorld::at(x, 0, to_radians(yaw_deg))};
  }
  EXPECT_TRUE(write_kitti_poses(folder / "poses.txt", trajectory, std::nullopt));
  std::ofstream times(folder / "times.txt");
  for (int i = 0; i < 12; ++i) times << i << "\n";
  return folder;
}

// As a vehicle moves: slowly, and back in reverse gear. What turns within a second, odometry does not follow.
fs::path there_and_back_slowly(const fs::path& folder) { return there_and_back(folder, 2.0, 0.0); }

const std::string kShortExclusion = " --retrieval.exclude_frames 4 --retrieval.exclude_s 4";

TEST(Cli, HelpTeachesAndWrongUseIsCode2) {
  const Outcome help = run("--help");
  EXPECT_EQ(help.code, 0);
  for (const char* word : {"detect", "evaluate", "describe", "calibrate", "info", "Exit code"})
    EXPECT_NE(help.output.find(word), std::string::npos) << word;
  EXPECT_NE(run("detect --help").output.find("candidates.csv"), std::string::npos);
  EXPECT_EQ(run("").code, 2);
  EXPECT_EQ(run("fly").code, 2);
  EXPECT_EQ(run("detect").code, 2);
  EXPECT_EQ(run("--version").code, 0);
}

TEST(Cli, AWrongParameterIsNamedWithItsAllowedRange) {
  const Outcome outcome = run("detect /tmp --out /tmp/x --descriptor.rings 9999");
  EXPECT_EQ(outcome.code, 2);
  EXPECT_NE(outcome.output.find("descriptor.rings = 9999 is not allowed; allowed: a whole number, 1 to 512"),
            std::string::npos)
      << outcome.output;
  const fs::path file = fresh_folder() / "p.toml";
  std::ofstream(file) << "[retrieval]\ntopk = 3\n";
  const Outcome unknown = run("parameters --parameters " + file.string());
  EXPECT_EQ(unknown.code, 2);
  EXPECT_NE(unknown.output.find("did you mean 'retrieval.top_k'"), std::string::npos) << unknown.output;
  EXPECT_NE(run("parameters --preset paper").output.find("min_score = 1.8"), std::string::npos);
}

TEST(Cli, DetectAndEvaluateARecordingWithLoops) {
  const fs::path folder = fresh_folder(), out = folder / "out";
  const fs::path recording = there_and_back_slowly(folder / "recording");
  const Outcome detect = run("detect " + recording.string() + " --out " + out.string() + kShortExclusion);
  ASSERT_EQ(detect.code, 0) << detect.output;
  const auto loops = read_loops(out / "loops.csv");
  ASSERT_TRUE(loops) << loops.error().message;
  EXPECT_GE(loops->size(), 3u) << detect.output;
  const auto candidates = read_candidates(out / "candidates.csv");
  ASSERT_TRUE(candidates);
  EXPECT_EQ(candidates->size(), 8u) << "frames 4 to 11 have a searchable past";
  for (const char* name : {"run.json", "poses.txt", "poses.tum"}) EXPECT_TRUE(fs::exists(out / name)) << name;
  EXPECT_NE(content(out / "run.json").find("\"retrieval.exclude_frames\": 4"), std::string::npos);

  const Outcome evaluate = run("evaluate " + out.string() + " --reference " + (recording / "poses.txt").string());
  ASSERT_EQ(evaluate.code, 0) << evaluate.output;
  EXPECT_NE(evaluate.output.find("Table 2"), std::string::npos);
  EXPECT_NE(content(out / "evaluation.json").find("\"false_loops\": 0"), std::string::npos) << evaluate.output;
  for (const char* name : {"precision_recall.png", "trajectory.png", "report.html"})
    EXPECT_GT(fs::file_size(out / name), 1000u) << name;
  EXPECT_EQ(content(out / "precision_recall.csv").find("score,precision,recall\n"), 0u);
  EXPECT_NE(content(out / "precision_recall.csv").find(",1.000000,"), std::string::npos) << "the surest is right";

  EXPECT_EQ(
      run("evaluate " + out.string() + " --reference " + (recording / "poses.txt").string() + " --exclude-frames -5")
          .code,
      2);
  EXPECT_EQ(
      run("evaluate " + out.string() + " --reference " + (recording / "poses.txt").string() + " --exclude-s nan").code,
      2);
  // What detect writes beside its results serves as a reference too, in both frames.
  for (const char* own : {"poses.txt", "poses.tum"}) {
    const Outcome scored = run("evaluate " + out.string() + " --reference " + (out / own).string());
    EXPECT_EQ(scored.code, 0) << scored.output;
    EXPECT_NE(content(out / "evaluation.json").find("\"false_loops\": 0"), std::string::npos) << own;
  }

  const Outcome again = run("detect " + recording.string() + " --out " + out.string());
  EXPECT_EQ(again.code, 1);
  EXPECT_NE(again.output.find("--overwrite"), std::string::npos) << "results are not lost by a second run";
}

TEST(Cli, CompareRunsEachMethodOverTheSameScans) {
  const fs::path folder = fresh_folder(), drive = there_and_back(folder / "drive"), out = folder / "compared";
  const std::string exclusion = " --retrieval.exclude_frames 3 --retrieval.exclude_s 3";
  const Outcome all = run("compare " + drive.string() + exclusion + " --out " + out.string());
  const Outcome pairs = run("compare " + drive.string() + exclusion + " --methods scan-context --pairs --out " +
                            (folder / "pairs").string());
  EXPECT_EQ(pairs.code, 1) << pairs.output;  // too short a drive for pairs 50 frames apart
  EXPECT_NE(pairs.output.find("no two of its frames"), std::string::npos) << pairs.output;
  ASSERT_EQ(all.code, 0) << all.output;
  for (const char* method : {"revisit", "revisit-retrieval", "isc-paper", "isc-program", "scan-context-ring-key",
                             "scan-context", "scan-context++", "m2dp", "glarot3d", "lidar-iris", "nbld", "ring",
                             "ring++", "contour-context", "std", "btc", "solid", "mapclosures"}) {
    EXPECT_NE(all.output.find(method), std::string::npos) << all.output;
    EXPECT_TRUE(fs::exists(out / method / "candidates.csv")) << method;
  }
  EXPECT_GT(fs::file_size(out / "precision_recall.png"), 1000u);
  EXPECT_NE(content(out / "comparison.json").find("\"recall_at_p100\""), std::string::npos);
  for (const char* method : {"m2dp", "glarot3d", "lidar-iris", "nbld", "ring", "ring++", "solid"}) {
    const auto rows = read_candidates(out / method / "candidates.csv");
    ASSERT_TRUE(rows) << method;
    EXPECT_EQ(rows->size(), 9u) << method;
    for (const CandidateRow& row : *rows) EXPECT_TRUE(row.match) << method;
  }
  // Scan Context answers every scan that has a past, ring key or not, with an earlier one.
  const auto answers = read_candidates(out / "scan-context" / "candidates.csv");
  ASSERT_TRUE(answers);
  EXPECT_EQ(answers->size(), 9u);
  for (const CandidateRow& row : *answers) EXPECT_LE(row.match->value, row.query.value - 3);

  EXPECT_TRUE(fs::exists(out / "ring" / "report.html"));
  EXPECT_GT(fs::file_size(out / "ring" / "trajectory.png"), 1000u);
  EXPECT_EQ(content(out / "isc-paper" / "failures.csv").find("query,what,match"), 0u);
  EXPECT_NE(content(out / "isc-paper" / "failures.csv").find(",missed,"), std::string::npos) << "it answers nothing";
  EXPECT_NE(content(out / "comparison.tex").find("scan-context++ &"), std::string::npos);
  EXPECT_NE(all.output.find("6-DoF"), std::string::npos) << all.output;
  EXPECT_NE(content(out / "comparison.csv").find(",3-DoF,1,"), std::string::npos);

  // What Scan Context answers is registered as ours is; answers from elsewhere are judged beside it.
  const fs::path verified = folder / "verified";
  const Outcome more = run("compare " + drive.string() + exclusion + " --methods revisit,scan-context --verify" +
                           " --candidates foreign=" + (out / "scan-context" / "candidates.csv").string() + " --out " +
                           verified.string());
  ASSERT_EQ(more.code, 0) << more.output;
  const auto ours = read_loops(verified / "revisit" / "loops.csv"),
             theirs = read_loops(verified / "scan-context" / "loops.csv");
  ASSERT_TRUE(ours && theirs);
  EXPECT_FALSE(ours->empty());
  EXPECT_FALSE(theirs->empty());
  const std::string csv = content(verified / "comparison.csv");
  const auto figures = [&](const std::string& name) {
    const std::size_t begin = csv.find("\n" + name + ",") + name.size() + 2;
    return csv.substr(begin, 60);  // of table 1
  };
  EXPECT_EQ(figures("foreign"), figures("scan-context")) << csv;
  const Outcome nameless = run("compare " + drive.string() + " --candidates file --out " + (folder / "z").string());
  EXPECT_EQ(nameless.code, 2) << nameless.output;

  const Outcome again = run("compare " + drive.string() + exclusion + " --methods m2dp --out " + out.string());
  EXPECT_EQ(again.code, 1) << again.output;  // results are there already
  const Outcome unknown = run("compare " + drive.string() + " --methods nothing --out " + (folder / "x").string());
  EXPECT_EQ(unknown.code, 2) << unknown.output;
  const Outcome blind = run("compare " + drive.string() + " --methods visual-words --out " + (folder / "v").string());
  EXPECT_EQ(blind.code, 1);
  EXPECT_NE(blind.output.find("simulated drives"), std::string::npos) << blind.output;
  fs::remove(drive / "poses.txt");
  const Outcome without = run("compare " + drive.string() + " --out " + (folder / "y").string());
  EXPECT_EQ(without.code, 1);
  EXPECT_NE(without.output.find("--poses"), std::string::npos) << without.output;
}

TEST(Cli, CompareLooksThroughTheCameraOfASimulatedDrive) {
  const fs::path folder = fresh_folder(), spec = folder / "drive.toml", out = folder / "compared";
  std::ofstream(spec) << "[simulation]\nsensor = \"vlp16\"\nlength_m = 60\nframes = 12\n";
  const Outcome compared =
      run("compare " + spec.string() + " --retrieval.exclude_frames 3 --retrieval.exclude_s 0.3 --methods " +
          "visual-words,visual-words-day-night --out " + out.string());
  ASSERT_EQ(compared.code, 0) << compared.output;
  const auto by_day = read_candidates(out / "visual-words" / "candidates.csv"),
             at_dusk = read_candidates(out / "visual-words-day-night" / "candidates.csv");
  ASSERT_TRUE(by_day && at_dusk);
  ASSERT_EQ(by_day->size(), 9u);
  for (const CandidateRow& row : *by_day) EXPECT_LE(row.match->value, row.query.value - 3);
  EXPECT_DOUBLE_EQ(by_day->front().score, at_dusk->front().score) << "both by day";
  EXPECT_GT(by_day->back().score, at_dusk->back().score) << "night against day";
}

// A map of `revisit slam` answers without its scans; the same folder is no recording.
TEST(Cli, DetectLooksForScansInASavedMap) {
  const fs::path folder = fresh_folder(), recording = there_and_back(folder / "recording"), map = folder / "map";
  const Outcome slam = run("slam " + recording.string() + " --odometry " + (recording / "poses.txt").string() +
                           " --out " + map.string());
  ASSERT_EQ(slam.code, 0) << slam.output;
  const std::string query = " --out " + (folder / "found").string() + " --overwrite";
  for (const fs::path& database : {map, map / "map.revisit"}) {
    const Outcome found = run("detect " + recording.string() + " --database " + database.string() + query);
    ASSERT_EQ(found.code, 0) << found.output;
    EXPECT_GE(read_loops(folder / "found" / "loops.csv")->size(), 10u) << found.output;
  }
  fs::remove(map / "map.revisit");
  const Outcome exports = run("detect " + recording.string() + " --database " + map.string() + query);
  EXPECT_EQ(exports.code, 1);
  EXPECT_NE(exports.output.find("holds a map"), std::string::npos) << exports.output;
}

TEST(Cli, ASearchWithoutAPastSaysSo) {
  const fs::path folder = fresh_folder(), recording = there_and_back(folder / "recording");
  const Outcome outcome = run("detect " + recording.string() + " --out " + (folder / "out").string());
  EXPECT_EQ(outcome.code, 0);
  EXPECT_NE(outcome.output.find("no scan had a searchable past"), std::string::npos) << outcome.output;
}

// 0.1 s a frame is a guess: by it, the 30 s of the exclusion would leave next to nothing to search.
TEST(Cli, WithoutTimesFramesAloneExclude) {
  const fs::path folder = fresh_folder(), recording = there_and_back(folder / "recording"), out = folder / "out";
  fs::remove(recording / "times.txt");
  const Outcome outcome =
      run("detect " + recording.string() + " --out " + out.string() + " --retrieval.exclude_frames 4");
  EXPECT_EQ(outcome.code, 0) << outcome.output;
  EXPECT_NE(outcome.output.find("the recording has no times: 0.1 s a frame is assumed"), std::string::npos)
      << outcome.output;
  EXPECT_EQ(read_candidates(out / "candidates.csv")->size(), 8u);
  EXPECT_GE(read_loops(out / "loops.csv")->size(), 3u);
  EXPECT_NE(content(out / "run.json").find("\"retrieval.exclude_s\": 0"), std::string::npos);
}

TEST(Cli, ABrokenScanAmongGoodOnesIsSkippedAndTold) {
  const fs::path folder = fresh_folder(), recording = there_and_back(folder / "recording"), out = folder / "out";
  fs::resize_file(recording / "velodyne" / "000003.bin", 1001);
  const Outcome outcome = run("detect " + recording.string() + " --out " + out.string() + kShortExclusion);
  EXPECT_EQ(outcome.code, 3) << outcome.output;
  EXPECT_NE(outcome.output.find("000003.bin: 1001 bytes"), std::string::npos) << outcome.output;
  EXPECT_NE(outcome.output.find("11 scans"), std::string::npos) << "the others are used";
  EXPECT_NE(content(out / "run.json").find("000003.bin"), std::string::npos);
}

TEST(Cli, RecordingsOfNoUseFailWithAMessage) {
  const fs::path folder = fresh_folder();
  const float nan = std::numeric_limits<float>::quiet_NaN();
  struct Case {
    const char* name;
    std::vector<Point> points;
    const char* message;
  };
  for (const Case& each : {Case{"empty_scan", {}, "empty file"},
                           {"one_point", {{20.f, 3.f, 0.f, 0.5f}}, "are needed to describe a place"},
                           {"one_cell", std::vector<Point>(500, {20.f, 3.f, 0.f, 0.5f}), "occupy 1 of"},
                           {"nan", std::vector<Point>(500, {nan, nan, nan, nan}), "500 not finite"}}) {
    const fs::path recording = folder / each.name;
    fs::create_directories(recording);
    for (int i = 0; i < 3; ++i) write_scan(recording, i, each.points);
    const Outcome outcome =
        run("detect " + recording.string() + " --out " + (folder / "out").string() + " --overwrite");
    EXPECT_EQ(outcome.code, 1) << each.name << ": " << outcome.output;
    EXPECT_NE(outcome.output.find(each.message), std::string::npos) << outcome.output;
    EXPECT_EQ(run("describe " + (recording / "000000.bin").string() + " --out " + (folder / "a.png").string()).code, 1)
        << each.name;
  }
  EXPECT_NE(run("detect /no/such --out /tmp/x").output.find("/no/such: no such file or folder"), std::string::npos);
  fs::create_directories(folder / "nothing");
  const Outcome nothing = run("detect " + (folder / "nothing").string() + " --out " + (folder / "o").string());
  EXPECT_EQ(nothing.code, 1);
  EXPECT_NE(nothing.output.find("holds no scan"), std::string::npos);
  EXPECT_FALSE(fs::exists(folder / "o")) << "no folder is made for nothing";
}

TEST(Cli, EqualIntensitiesAreToldAndGeometryServes) {
  const fs::path folder = fresh_folder(), recording = there_and_back_slowly(folder / "recording");
  for (const auto& entry : fs::directory_iterator(recording / "velodyne")) {
    std::vector<Point> points(fs::file_size(entry) / sizeof(Point));
    std::ifstream(entry.path(), std::ios::binary)
        .read(reinterpret_cast<char*>(points.data()), static_cast<std::streamsize>(points.size() * sizeof(Point)));
    for (Point& p : points) p.intensity = 7.f;
    write_points(entry.path(), points);
  }
  const Outcome outcome = run("detect " + recording.string() + " --out " + (folder / "out").string() + kShortExclusion);
  EXPECT_EQ(outcome.code, 3) << outcome.output;
  EXPECT_NE(outcome.output.find("all intensities are equal"), std::string::npos) << outcome.output;
  EXPECT_GE(read_loops(folder / "out" / "loops.csv")->size(), 3u);
}

TEST(Cli, AFullDiskIsToldNotIgnored) {
  if (!fs::exists("/dev/full")) GTEST_SKIP() << "needs /dev/full";
  const fs::path folder = fresh_folder(), recording = there_and_back(folder / "recording"), out = folder / "out";
  for (const char* name : {"candidates.csv", "loops.csv", "poses.txt", "run.json"}) {
    fs::remove_all(out);
    fs::create_directories(out);
    fs::create_symlink("/dev/full", out / name);
    const Outcome outcome =
        run("detect " + recording.string() + " --overwrite --out " + out.string() + kShortExclusion);
    EXPECT_EQ(outcome.code, 1) << name << ": " << outcome.output;
    EXPECT_NE(outcome.output.find(std::string(name) + ": cannot be written: No space left on device"),
              std::string::npos)
        << outcome.output;
  }
  fs::create_symlink("/dev/full", folder / "full.png");
  EXPECT_EQ(
      run("describe " + (recording / "velodyne" / "000000.bin").string() + " --out " + (folder / "full.png").string())
          .code,
      1);
}

TEST(Cli, AFolderThatMayNotBeReadIsNamed) {
  const fs::path folder = fresh_folder(), locked = folder / "locked";
  fs::create_directories(locked);
  write_scan(locked, 0, scan_at(0));
  fs::permissions(locked, fs::perms::none);
  // Root reads everything: ask as somebody else.
  const pid_t child = fork();
  if (child == 0) {
    if (geteuid() == 0 && (setgid(65534) != 0 || setuid(65534) != 0)) _exit(99);
    if (access(REVISIT_PROGRAM, X_OK) != 0) _exit(99);  // built where only root may go
    const Outcome outcome = run("info " + locked.string());
    _exit(outcome.code == 1 && outcome.output.find("Permission denied") != std::string::npos ? 0 : 1);
  }
  int status = 0;
  waitpid(child, &status, 0);
  fs::permissions(locked, fs::perms::owner_all);
  if (WEXITSTATUS(status) == 99) GTEST_SKIP() << "no other user can run " REVISIT_PROGRAM;
  EXPECT_EQ(WEXITSTATUS(status), 0);
}

// 400 scans of one place.
fs::path long_wait(const fs::path& recording) {
  fs::create_directories(recording);
  for (int i = 0; i < 3; ++i) write_scan(recording, i, scan_at(0.5 * i));
  for (int i = 3; i < 400; ++i) {
    char name[32];
    std::snprintf(name, sizeof name, "%06d.bin", i);
    fs::create_symlink(recording / "000001.bin", recording / name);
  }
  return recording;
}

// Runs the program until `file` holds its second row, and interrupts it. The exit code; -1 where it ended before.
int interrupt_after_a_row(std::vector<std::string> arguments, const fs::path& file) {
  const pid_t child = fork();
  if (child == 0) {
    if (!std::freopen("/dev/null", "w", stderr) || !std::freopen("/dev/null", "w", stdout)) _exit(127);
    std::vector<char*> argv;
    for (std::string& each : arguments) argv.push_back(each.data());
    argv.push_back(nullptr);
    execv(REVISIT_PROGRAM, argv.data());
    _exit(127);
  }
  int status = 0;
  while (!fs::exists(file) || content(file).find('\n', 80) == std::string::npos) {
    if (waitpid(child, &status, WNOHANG) != 0) return -1;
    usleep(2000);
  }
  kill(child, SIGINT);
  waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

TEST(Cli, CtrlCLeavesCompleteRows) {
  const fs::path folder = fresh_folder(), recording = long_wait(folder / "recording"), out = folder / "out";
  ASSERT_EQ(interrupt_after_a_row({"revisit", "detect", recording, "--out", out, "--retrieval.exclude_frames", "2",
                                   "--retrieval.exclude_s", "0"},
                                  out / "loops.csv"),
            130);
  const auto rows = read_candidates(out / "candidates.csv");
  ASSERT_TRUE(rows) << rows.error().message;
  EXPECT_GE(rows->size(), 1u);
  EXPECT_LT(rows->size(), 398u);
  EXPECT_TRUE(read_loops(out / "loops.csv"));
  EXPECT_EQ(content(out / "candidates.csv").back(), '\n');
  EXPECT_NE(content(out / "run.json").find("\"interrupted\": true"), std::string::npos);
}

TEST(Cli, ComparisonThatIsInterruptedIsJudgedByWhatWasReached) {
  const fs::path folder = fresh_folder(), recording = long_wait(folder / "recording"), out = folder / "out";
  std::ofstream poses(folder / "poses.txt");
  for (int i = 0; i < 400; ++i) poses << "1 0 0 " << std::min(i, 1) * 0.5 << " 0 1 0 0 0 0 1 0\n";
  poses.close();
  ASSERT_EQ(interrupt_after_a_row(
                {"revisit", "compare", recording, "--poses", folder / "poses.txt", "--out", out, "--methods",
                 "scan-context", "--retrieval.exclude_frames", "2", "--retrieval.exclude_s", "0"},
                out / "scan-context" / "candidates.csv"),
            130);
  const auto rows = read_candidates(out / "scan-context" / "candidates.csv");
  ASSERT_TRUE(rows) << rows.error().message;
  const std::string table = content(out / "comparison.csv");
  const std::string none_missed = "scan-context," + std::to_string(rows->size()) + ",1.000000,";
  EXPECT_NE(table.find(none_missed), std::string::npos) << table;
}

TEST(Cli, DescribeDrawsAndInfoTells) {
  const fs::path folder = fresh_folder(), recording = there_and_back(folder / "recording");
  const std::string scan = (recording / "velodyne" / "000000.bin").string();
  const Outcome describe = run("describe " + scan + " --out " + (folder / "a.png").string());
  EXPECT_EQ(describe.code, 0) << describe.output;
  EXPECT_EQ(content(folder / "a.png").substr(1, 3), "PNG");
  const Outcome info = run("info " + recording.string());
  EXPECT_EQ(info.code, 0) << info.output;
  for (const char* fact :
       {"KITTI odometry folder", "scans        12", "poses        12", "rate         1.00 Hz", "rings        32"})
    EXPECT_NE(info.output.find(fact), std::string::npos) << fact << "\n" << info.output;
  for (const char* wrong : {"a.jpg", "000000.bin", "no/such/folder/a.png"})
    EXPECT_EQ(run("describe " + scan + " --out " + (folder / wrong).string()).code, 2) << "nothing else is overwritten";
  EXPECT_NE(
      run("describe " + recording.string() + " --out " + (folder / "b.png").string()).output.find("is a recording"),
      std::string::npos);
  EXPECT_EQ(run("info " + scan).code, 0);
  EXPECT_NE(run("info /no/such/thing").output.find("/no/such/thing: no such file or folder"), std::string::npos);
  EXPECT_EQ(run("info /no/such.bin").code, 1);
}

TEST(Cli, CalibrateLearnsAndDetectApplies) {
  const fs::path folder = fresh_folder(), recording = there_and_back(folder / "recording"), phi = folder / "phi.json";
  const Outcome learn = run("calibrate " + recording.string() + " --out " + phi.string());
  ASSERT_EQ(learn.code, 0) << learn.output;
  EXPECT_NE(learn.output.find("disagreement"), std::string::npos);
  std::ofstream(folder / "notes.txt") << "precious";
  EXPECT_EQ(run("calibrate " + recording.string() + " --out " + (folder / "notes.txt").string()).code, 2);
  EXPECT_EQ(content(folder / "notes.txt"), "precious");
  const Outcome apply =
      run("detect " + recording.string() + " --out " + (folder / "out").string() + " --calibration " + phi.string());
  EXPECT_EQ(apply.code, 0) << apply.output;
  std::ofstream(phi) << "{}";
  EXPECT_EQ(run("describe " + (recording / "velodyne" / "000000.bin").string() + " --out " +
                (folder / "a.png").string() + " --calibration " + phi.string())
                .code,
            1);
}

TEST(CliOnRealScans, WhatTheProjectMustShow) {
  REVISIT_NEEDS_SHARED_DATA();
  const fs::path folder = fresh_folder();
  const std::string raw = (shared_data() / "kitti_raw_0005").string();
  // Ten frames apart every scan has a neighbour 3 to 4.5 m behind: each accepted loop must agree with GPS/IMU.
  ASSERT_EQ(run("detect " + raw + " --out " + (folder / "raw").string() +
                " --retrieval.exclude_frames 10 --retrieval.exclude_s 1")
                .code,
            0);
  const Outcome evaluate = run("evaluate " + (folder / "raw").string() + " --reference " + raw);
  ASSERT_EQ(evaluate.code, 0) << evaluate.output;
  const std::string figures = content(folder / "raw" / "evaluation.json");
  EXPECT_NE(figures.find("\"false_loops\": 0"), std::string::npos) << evaluate.output;
  EXPECT_EQ(figures.find("\"accepted\": 0"), std::string::npos) << evaluate.output;
}

}  // namespace
}  // namespace revisit
