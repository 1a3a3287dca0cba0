// SPDX-License-Identifier: Apache-2.0
#include <revisit/pipeline/slam.hpp>

#include <cmath>
#include <filesystem>
#include <vector>

#include <gtest/gtest.h>
#include <oneapi/tbb/global_control.h>

#include <revisit/store/keyframe_bytes.hpp>

#include "synthetic_world.hpp"

namespace revisit {
namespace {

using testing_support::SyntheticWorld;

constexpr double kStep_m = 0.7;
constexpr int kOut = 90, kTurn = 30, kScans = 2 * kOut + kTurn;

// Out along x, round on the spot, and back.
Pose pose_of(int i) {
  const double start_m = -35.0, end_m = start_m + kStep_m * kOut;
  if (i < kOut) return SyntheticWorld::at(start_m + kStep_m * i, 0.0, 0.0);
  if (i < kOut + kTurn) return SyntheticWorld::at(end_m, 0.0, kPi * (i - kOut) / kTurn);
  return SyntheticWorld::at(end_m - kStep_m * (i - kOut - kTurn), 0.5, kPi);
}

Scan scan_at(int i) {
  static const SyntheticWorld world(61);
  Scan scan = world.scan(pose_of(i), {16, 360, -20.0, 6.0}, static_cast<unsigned>(i));
  scan.frame = FrameId{i};
  scan.stamp_s = 0.1 * i;
  return scan;
}

Parameters parameters() {
  Parameters p;
  p.retrieval.exclude_frames = 20;
  p.retrieval.exclude_s = 2.0;
  return p;
}

IntensityScale as_it_is() {
  IntensityScale scale;
  scale.full_scale = 1.0;
  return scale;
}

struct Drive {
  explicit Drive(const std::string& name, bool is_new = true) {
    const auto file = std::filesystem::path(testing::TempDir()) / ("revisit_slam_" + name + ".map");
    if (is_new)
      for (const char* ending : {"", "-wal", "-shm"}) std::filesystem::remove(file.string() + ending);
    auto store = is_new ? MapStore::create(file) : MapStore::open(file);
    SlamSetup setup;
    setup.scale = as_it_is();
    setup.checkpoint_every_s = 0.0;
    setup.log = [this](LogLevel, const std::string& text) { log += text + '\n'; };
    auto started = Slam::open(std::make_shared<MapStore>(*std::move(store)), parameters(), setup);
    if (started) slam.emplace(*std::move(started));
  }

  void go(int first, int last) {
    for (int i = first; i < last; ++i) feed(scan_at(i));
  }
  void feed(Scan scan) {
    const auto step = slam->process(std::move(scan));
    if (!step) {
      ++refused;
      return;
    }
    untracked += !step->is_tracked;
    loops += step->loops_entered;
    segments += step->starts_segment;
  }
  // The farthest that a pose of these frames is off, from the first pose on.
  double worst_m(int first, int last) {
    const auto trajectories = slam->trajectories();
    EXPECT_TRUE(trajectories);
    double worst = 0.0;
    for (int i = first; i < last; ++i)
      if (const auto found = trajectories->corrected.at({i})) {
        const Pose truth = pose_of(0).inverse() * pose_of(i);
        worst = std::max(worst, (truth.translation() - found->translation()).norm());
      }
    return worst;
  }

  std::string log;
  std::optional<Slam> slam;
  std::size_t loops = 0;
  int untracked = 0, refused = 0, segments = 0;
};

TEST(Slam, GoesOutAndBackAndKnowsIt) {
  Drive drive("whole");
  drive.go(0, kScans);
  ASSERT_TRUE(drive.slam->finish());
  EXPECT_EQ(drive.untracked, 0);
  EXPECT_EQ(drive.refused, 0);
  EXPECT_GT(drive.loops, 10u);
  EXPECT_LT(drive.worst_m(0, kScans), 0.15) << "over " << 2 * kOut * kStep_m << " m";
  EXPECT_EQ(drive.slam->trajectories()->corrected.entries.size(), std::size_t{kScans});
  EXPECT_EQ(drive.slam->graph().graph().nodes().size(), drive.slam->graph().keyframes().size());
}

TEST(Slam, DoesNotDependOnTheNumberOfThreads) {
  std::vector<Pose> poses;
  for (const std::size_t threads : {1, 4}) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    Drive drive("threads" + std::to_string(threads));
    drive.go(0, 40);
    poses.push_back(drive.slam->trajectories()->corrected.at({39}).value());
  }
  EXPECT_EQ(poses[0].matrix(), poses[1].matrix());
}

TEST(Slam, AGapInWhichNobodyKnowsHowItWent) {
  Drive drive("gap");
  drive.go(0, 25);
  // It stood still and went off elsewhere: 35 m in 5 s.
  drive.go(75, kScans);
  ASSERT_TRUE(drive.slam->finish());
  EXPECT_LT(drive.worst_m(130, kScans), 0.5) << drive.log << "the way back leads to where it was known";
}

TEST(Slam, DuplicateAndBackwardTimes) {
  Drive drive("times");
  for (int i = 0; i < 30; ++i) {
    Scan scan = scan_at(i);
    if (i >= 12) scan.stamp_s = 1.1;             // a clock that stands still,
    if (i >= 20) scan.stamp_s = 0.1 * i - 10.0;  // then one that was set back
    drive.feed(std::move(scan));
  }
  EXPECT_EQ(drive.refused, 0);
  EXPECT_EQ(drive.untracked, 0);
  EXPECT_LT(drive.worst_m(0, 30), 0.1);
  EXPECT_NE(drive.log.find("frame 12: its stamp is not after"), std::string::npos);
}

TEST(Slam, TwentyEmptyScans) {
  Drive drive("empty");
  drive.go(0, 30);
  for (int i = 30; i < 50; ++i) {
    Scan empty;
    empty.frame = FrameId{i};
    empty.stamp_s = 0.1 * i;
    drive.feed(std::move(empty));
  }
  EXPECT_EQ(drive.refused, 20);
  drive.go(50, 70);
  EXPECT_EQ(drive.untracked, 0) << drive.log;
  EXPECT_LT(drive.worst_m(0, 70), 0.1);
}

TEST(Slam, ATeleportedRobotFindsItsPlaceAgain) {
  Drive drive("teleport");
  drive.go(0, 80);
  // Back to where it was 40 m before, at once; the scans go on from there under new numbers.
  for (int i = 0; i < 30; ++i) {
    Scan scan = scan_at(20 + i);
    scan.frame = FrameId{80 + i};
    scan.stamp_s = 8.0 + 0.1 * i;
    drive.feed(std::move(scan));
  }
  ASSERT_TRUE(drive.slam->finish());
  EXPECT_EQ(drive.segments, 1) << drive.log;
  EXPECT_GT(drive.untracked, 0);
  EXPECT_NE(drive.log.find("found again in the map"), std::string::npos) << drive.log;
  const Pose found = drive.slam->trajectories()->corrected.at({105}).value();
  const Pose truth = pose_of(0).inverse() * pose_of(45);
  EXPECT_LT((found.translation() - truth.translation()).norm(), 0.3);
}

TEST(Slam, GoesOnWhereAKillLeftIt) {
  std::optional<FrameId> last;
  {
    Drive drive("resumed");
    drive.go(0, 101);  // in the middle of the turn, without finish(): what is not committed is lost
  }
  Drive drive("resumed", false);
  ASSERT_TRUE(drive.slam);
  last = drive.slam->last_frame();
  ASSERT_TRUE(last);
  EXPECT_GT(last->value, 90);
  drive.go(static_cast<int>(last->value) + 1, kScans);
  ASSERT_TRUE(drive.slam->finish());
  EXPECT_EQ(drive.untracked, 0) << drive.log;
  EXPECT_GT(drive.loops, 10u) << "with places of before";
  EXPECT_LT(drive.worst_m(0, kScans), 0.2);
  EXPECT_EQ(drive.slam->trajectories()->corrected.entries.size(), std::size_t{kScans});
}

// Odometry's surroundings, loops that wait, what was learnt: all of it is there again.
TEST(Slam, GoesOnAsIfItHadNotBeenKilled) {
  const auto poses_of = [](const Drive& drive) {
    std::vector<Eigen::Matrix4d> poses;
    const auto trajectories = drive.slam->trajectories();
    for (const Trajectory* each : {&trajectories->odometry, &trajectories->corrected})
      for (const auto& [frame, entry] : each->entries) poses.push_back(entry.T_world_lidar.matrix());
    return poses;
  };
  Drive whole("never_killed");
  whole.go(0, kScans);
  ASSERT_TRUE(whole.slam->finish());
  // Early, in the turn, after the first loops, and once it was finished.
  std::size_t loops = 0;
  for (int killed = 0, done = 0; const int at : {1, 7, 60, 101, 115, 118, kScans, kScans}) {
    Drive drive("often_killed", killed++ == 0);
    ASSERT_TRUE(drive.slam) << at;
    if (const auto last = drive.slam->last_frame()) done = static_cast<int>(last->value) + 1;
    drive.go(done, at);
    loops += drive.loops;
    if (at < kScans) continue;
    ASSERT_TRUE(drive.slam->finish());
    EXPECT_EQ(poses_of(drive), poses_of(whole)) << at;
    EXPECT_EQ(drive.slam->store().edges()->size(), whole.slam->store().edges()->size());
  }
  EXPECT_GE(loops, whole.loops);
}

// What a sensor of 130 degrees saw before each key frame is stored with it, also by a run that was killed and goes on.
TEST(Slam, ANarrowSensorsKeyFramesHoldWhatWasSeenBefore) {
  const auto go = [](Drive& drive, int first, int last) {
    for (int i = first; i < last; ++i) {
      Scan scan = scan_at(i);
      std::erase_if(scan.points, [](const Point& p) { return std::abs(std::atan2(p.y, p.x)) > to_radians(65.0); });
      drive.feed(std::move(scan));
    }
  };
  const auto places_of = [](const Drive& drive) {
    std::vector<Bytes> places;
    for (const FrameId frame : drive.slam->graph().keyframes())
      places.push_back(*drive.slam->store().part(frame, MapStore::Part::kPlace));
    return places;
  };
  constexpr int kFrom = kOut - 30, kTo = kOut;
  Drive whole("narrow");
  go(whole, kFrom, kTo);
  const auto places = places_of(whole);
  ASSERT_GT(places.size(), 5u);
  EXPECT_FALSE(to_thin_cloud(places.front())->before) << "nothing was";
  EXPECT_TRUE(to_thin_cloud(places.back())->before);
  for (int killed = 0, done = kFrom; const int at : {kFrom + 7, kFrom + 18, kTo}) {
    Drive drive("narrow_killed", killed++ == 0);
    ASSERT_TRUE(drive.slam) << at;
    if (const auto last = drive.slam->last_frame()) done = static_cast<int>(last->value) + 1;
    go(drive, done, at);
    if (at == kTo) {
      EXPECT_EQ(places_of(drive), places);
    }
  }
}

// A map may come from anybody: whatever its state says, it is refused, or a run goes on with it.
TEST(Slam, AStateThatSomebodyAlteredIsRefusedOrGoesOn) {
  Bytes state;
  {
    Drive drive("altered");
    drive.go(0, 40);
    state = *drive.slam->store().state();
  }
  ASSERT_GT(state.size(), 10'000u);
  const auto file = std::filesystem::path(testing::TempDir()) / "revisit_slam_altered.map";
  int refused = 0;
  constexpr int kTrials = 40;
  for (int trial = 0; trial < kTrials; ++trial) {
    Bytes altered = state;
    // The first numbers are those of the odometry and its surroundings, the last ones those of the graph.
    const std::size_t at = trial % 3 == 0   ? 20 + static_cast<std::size_t>(trial) * 7
                           : trial % 3 == 1 ? state.size() - 1 - static_cast<std::size_t>(trial) * 97
                                            : state.size() / kTrials * static_cast<std::size_t>(trial);
    if (trial % 10 == 9)
      altered.resize(at);
    else
      altered[at] = static_cast<std::byte>(trial % 2 == 0 ? 0xff : 0x80) ^ altered[at];
    ASSERT_TRUE([&] {
      auto store = MapStore::open(file);
      return store && store->set_state(altered) && store->commit();
    }());
    Drive drive("altered", false);
    if (!drive.slam) {
      ++refused;
      continue;
    }
    drive.go(40, 42);
    (void)drive.slam->checkpoint();
  }
  EXPECT_GE(refused, kTrials / 10) << "those that were cut off, for one";
}

// Killed on its way out, and on its way back when it is started again: wheels say how far it went.
TEST(Slam, WheelsBridgeTheTimeWithoutIt) {
  const auto wheels = [](int i) { return Pose(SyntheticWorld::at(7.0, 3.0, 0.4) * pose_of(i)); };
  constexpr int kKilled = 40, kBack = kOut + kTurn + 30;
  for (const bool has_wheels : {true, false}) {
    {
      Drive before(has_wheels ? "wheels" : "no_wheels");
      for (int i = 0; i < kKilled; ++i)
        ASSERT_TRUE(before.slam->process(scan_at(i), has_wheels ? std::optional(wheels(i)) : std::nullopt));
    }
    Drive after(has_wheels ? "wheels" : "no_wheels", false);
    ASSERT_TRUE(after.slam) << after.log;
    const auto step = after.slam->process(scan_at(kBack), has_wheels ? std::optional(wheels(kBack)) : std::nullopt);
    ASSERT_TRUE(step) << step.error().message;
    const Pose error = step->T_world_lidar.inverse() * pose_of(0).inverse() * pose_of(kBack);
    EXPECT_EQ(to_degrees(rotation_angle(error)) < 2.0, has_wheels) << to_degrees(rotation_angle(error));
  }
}

TEST(Slam, KeepsWhereAnAccelerometerFeelsUp) {
  Drive drive("gravity");
  const Eigen::Vector3f up = Eigen::Vector3f(0.1f, -0.05f, 1.f).normalized();  // it is mounted so
  for (int i = 0; i < kOut; ++i) {
    Scan scan = scan_at(i);
    for (int k = -9; k <= 0; ++k) scan.imu.push_back({0.01 * k, Eigen::Vector3f::Zero(), 9.81f * up});
    drive.feed(std::move(scan));
  }
  ASSERT_TRUE(drive.slam->finish());
  const auto ups = drive.slam->store().ups();
  ASSERT_TRUE(ups);
  ASSERT_EQ(ups->size(), 2u) << "9 s: one reading in four";
  for (const StoredUp& each : *ups) {
    EXPECT_LT((each.up - up.cast<double>()).norm(), 0.01) << each.up.transpose();
    EXPECT_TRUE(drive.slam->graph().has(each.keyframe));
  }
}

// A receiver speaks twice a second, and after the scans that it is about.
TEST(Slam, FixesOfAReceiverAtWorkAreKeptByKeyFrame) {
  Drive drive("gps");
  constexpr double kMetresADegree = 111'320.0;
  for (int i = 0; i < kOut; ++i) {
    drive.go(i, i + 1);
    if (i % 5 != 0 || i == 40 || i == 45 || i == 50 || i == 55) continue;  // a gap of 2.5 s
    const double latitude_deg = (pose_of(i).translation().x() - pose_of(0).translation().x()) / kMetresADegree;
    ASSERT_TRUE(drive.slam->add(GpsFix{0.1 * i, latitude_deg, 8.0, 400.0, {1.0, 1.0, 2.0}}));
  }
  ASSERT_TRUE(drive.slam->finish());
  const auto fixes = drive.slam->store().fixes();
  ASSERT_TRUE(fixes);
  EXPECT_GE(fixes->size(), 4u);
  EXPECT_LE(fixes->size(), 7u) << "one in ten metres";
  for (const StoredFix& each : *fixes) {
    const int i = static_cast<int>(each.keyframe.value);
    EXPECT_NEAR(each.fix.latitude_deg * kMetresADegree, kStep_m * i, 0.01) << i;
    EXPECT_FALSE(i > 35 && i < 60) << "in the gap";
  }
}

TEST(Slam, TakesAnotherOdometryAsItIs) {
  const auto file = std::filesystem::path(testing::TempDir()) / "revisit_slam_external.map";
  for (const char* ending : {"", "-wal", "-shm"}) std::filesystem::remove(file.string() + ending);
  auto slam = Slam::open(std::make_shared<MapStore>(*MapStore::create(file)), parameters(),
                         {as_it_is(), {}, Odometry::Source::kExternal, {}});
  ASSERT_TRUE(slam);
  const Pose T_elsewhere = planar_pose(100, 50, 2.0);
  // Enough of them for rounding to grow, were rotations not kept orthonormal.
  for (int i = 0; i < kScans; ++i) {
    const auto step = slam->process(scan_at(i), T_elsewhere * pose_of(i));
    ASSERT_TRUE(step) << "scan " << i << ": " << step.error().message;
  }
  const auto trajectories = slam->trajectories();
  ASSERT_TRUE(trajectories);
  const Pose truth = pose_of(0).inverse() * pose_of(kScans - 1);
  EXPECT_TRUE(trajectories->odometry.at({kScans - 1})->isApprox(pose_of(0).inverse() * pose_of(kScans - 1), 1e-6));
  EXPECT_TRUE(trajectories->corrected.at({kScans - 1})->isApprox(truth, 0.02));
}

}  // namespace
}  // namespace revisit
