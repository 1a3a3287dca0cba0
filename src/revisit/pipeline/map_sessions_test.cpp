// SPDX-License-Identifier: Apache-2.0
// Several sessions in one map: added one after the other, or merged.
#include <fstream>
#include <functional>
#include <map>

#include <gtest/gtest.h>

#include <revisit/localisation/saved_map.hpp>
#include <revisit/pipeline/merge_maps.hpp>
#include <revisit/pipeline/slam.hpp>

#include "shared_data.hpp"
#include "synthetic_world.hpp"

namespace revisit {
namespace {

namespace fs = std::filesystem;
using testing_support::fresh_folder;
using testing_support::SyntheticWorld;

const SyntheticWorld::Sensor kSixteenLines{16, 360, -20.0, 6.0};
constexpr int kSessionScans = 60;
constexpr double kSessionStep_m = 0.7;

// Sessions drive the same road: there, and back beside it.
Pose there(int i) { return SyntheticWorld::at(-20.0 + kSessionStep_m * i, 0.0, 0.0); }
Pose back(int i) { return SyntheticWorld::at(22.0 - kSessionStep_m * i, 0.8, kPi); }

using PoseOf = std::function<Pose(int)>;
std::unique_ptr<Slam> drive(const fs::path& folder, const PoseOf& pose_of, int world, bool new_session = false) {
  SlamSetup setup;
  setup.scale.emplace().full_scale = 1.0;
  setup.new_session = new_session;
  setup.recording = folder.string();
  auto slam = Slam::open(folder, {}, setup);
  EXPECT_TRUE(slam) << slam.error().message;
  if (!slam) return nullptr;
  const SyntheticWorld town(static_cast<unsigned>(world));
  for (int i = 0; i < kSessionScans; ++i) {
    Scan scan = town.scan(pose_of(i), kSixteenLines, static_cast<unsigned>(world * 1000 + i));
    scan.frame = FrameId{i};
    scan.stamp_s = 0.1 * i;
    for (int k = -9; k <= 0; ++k) scan.imu.push_back({0.01 * k, Eigen::Vector3f::Zero(), {0.f, 0.f, 9.81f}});
    EXPECT_TRUE(slam->process(std::move(scan)));
  }
  EXPECT_TRUE(slam->finish());
  return std::make_unique<Slam>(*std::move(slam));
}

// How far the map has the last key frame of session b from where the truth has it, seen from the first one of a.
double off_m(const SavedMap& map, int a, const PoseOf& pose_a, int b, const PoseOf& pose_b) {
  std::optional<FrameId> first, last;
  for (const auto& each : map.stored().keyframes) {
    const FrameId frame = each.frame.frame;
    if (session_of(frame) == a && !first) first = frame;
    if (session_of(frame) == b) last = frame;
  }
  const Pose truth = pose_a(static_cast<int>(in_recording(*first).value)).inverse() *
                     pose_b(static_cast<int>(in_recording(*last).value));
  return (truth.inverse() * map.T_map_lidar(*first).inverse() * map.T_map_lidar(*last)).translation().norm();
}

TEST(MapSessions, ASecondSessionIsFoundInTheMap) {
  const fs::path folder = fresh_folder();
  std::size_t places_before = 0;
  {
    const auto first = drive(folder, there, 61);
    ASSERT_TRUE(first);
    places_before = first->graph().keyframes().size();
  }
  {
    const auto second = drive(folder, back, 61, true);
    ASSERT_TRUE(second);
    EXPECT_EQ(second->session(), 1);
    EXPECT_TRUE(second->is_joined());
    EXPECT_EQ(second->last_frame(), FrameId{kSessionScans - 1});
    const auto trajectories = second->trajectories();
    ASSERT_TRUE(trajectories);
    EXPECT_EQ(trajectories->corrected.entries.size(), std::size_t{kSessionScans}) << "of this session alone";
    EXPECT_TRUE(trajectories->corrected.at({5}));
  }
  const auto map = SavedMap::open(folder);
  ASSERT_TRUE(map) << map.error().message;
  ASSERT_EQ(map->stored().sessions.size(), 2u);
  EXPECT_GT(map->stored().keyframes.size(), places_before);
  EXPECT_EQ(map->part(map->stored().keyframes.back().frame.frame), 0);
  EXPECT_LT(off_m(*map, 0, there, 1, back), 0.3);
}

TEST(MapSessions, AnInterruptedSessionGoesOn) {
  const fs::path folder = fresh_folder();
  (void)drive(folder, there, 61);
  {
    SlamSetup setup;
    setup.scale.emplace().full_scale = 1.0;
    setup.new_session = true;
    auto slam = Slam::open(folder, {}, setup);
    ASSERT_TRUE(slam);
    Scan scan = SyntheticWorld(61).scan(back(0), kSixteenLines, 1);
    ASSERT_TRUE(slam->process(std::move(scan)));
    ASSERT_TRUE(slam->checkpoint());
  }
  SlamSetup setup;
  setup.scale.emplace().full_scale = 1.0;
  auto slam = Slam::open(folder, {}, setup);
  ASSERT_TRUE(slam) << slam.error().message;
  EXPECT_EQ(slam->session(), 1);
  EXPECT_EQ(slam->last_frame(), FrameId{0});
  Scan scan = SyntheticWorld(61).scan(back(1), kSixteenLines, 2);
  scan.frame = FrameId{1};
  scan.stamp_s = 0.1;
  EXPECT_TRUE(slam->process(std::move(scan)));
}

// What visits of known ground leave is put away when the next session begins; the map stays whole and where it was.
TEST(MapSessions, KnownGroundAddsNothingForGood) {
  const fs::path folder = fresh_folder();
  (void)drive(folder, there, 61);
  std::size_t keyframes_of_first = 0, keyframes_before = 0;
  for (int session = 1; session <= 4; ++session) {
    const auto visit = drive(folder, session % 2 == 1 ? PoseOf(back) : PoseOf(there), 61, true);
    ASSERT_TRUE(visit);
    EXPECT_TRUE(visit->is_joined()) << session;
    EXPECT_EQ(visit->store().visits()->size(), 0u) << "compared, then forgotten";
    std::map<int, std::size_t> keyframes;
    for (const FrameId frame : visit->graph().keyframes()) ++keyframes[session_of(frame)];
    if (session == 1) keyframes_of_first = keyframes[0];
    EXPECT_EQ(keyframes[0], keyframes_of_first) << "the first session keeps all it has";
    std::size_t of_earlier = 0;
    for (int earlier = 1; earlier < session; ++earlier) of_earlier += keyframes[earlier];
    EXPECT_LE(of_earlier, keyframes_of_first / 3) << "after session " << session;
    if (session >= 3) {
      EXPECT_LE(visit->graph().keyframes().size(), keyframes_before + keyframes_of_first / 5);
    }
    keyframes_before = visit->graph().keyframes().size();
    EXPECT_EQ(visit->trajectories()->corrected.entries.size(), std::size_t{kSessionScans});
    const auto ups = visit->store().ups();
    for (const StoredUp& each : *ups) EXPECT_TRUE(visit->graph().has(each.keyframe)) << session;
  }
  const auto map = SavedMap::open(folder);
  ASSERT_TRUE(map) << map.error().message;
  EXPECT_TRUE(map->store()->check());
  EXPECT_EQ(map->stored().sessions.size(), 5u);
  EXPECT_LT(off_m(*map, 0, there, 4, there), 0.3);
}

// A session that goes on to new ground: what joins that to the map stays, with the odometry between.
TEST(MapSessions, NewGroundStaysJoinedWhenKnownGroundGoes) {
  const fs::path folder = fresh_folder();
  const auto farther = [](int i) { return SyntheticWorld::at(-5.0 + kSessionStep_m * i, 0.3, 0.0); };
  (void)drive(folder, there, 61);
  ASSERT_TRUE(drive(folder, farther, 61, true)->is_joined());
  const auto before = SavedMap::open(folder);
  ASSERT_TRUE(before);
  const auto third = drive(folder, there, 61, true);
  ASSERT_TRUE(third->is_joined());
  std::map<int, std::size_t> keyframes;
  for (const FrameId frame : third->graph().keyframes()) {
    ++keyframes[session_of(frame)];
    EXPECT_EQ(third->graph().part(frame), 0);
  }
  std::size_t of_second = 0;
  for (const auto& each : before->stored().keyframes) of_second += session_of(each.frame.frame) == 1;
  EXPECT_GT(keyframes[1], 3u) << "what is new";
  EXPECT_LT(keyframes[1], of_second) << "not what was known";
  const auto map = SavedMap::open(folder);
  ASSERT_TRUE(map) << map.error().message;
  EXPECT_LT(off_m(*map, 0, there, 1, farther), 0.4);
}

TEST(MapSessions, AnotherPlaceWaitsBesideTheMap) {
  const fs::path folder = fresh_folder();
  (void)drive(folder, there, 61);
  const auto second = drive(folder, there, 77, true);
  ASSERT_TRUE(second);
  EXPECT_FALSE(second->is_joined());
}

TEST(MergeMaps, JoinsWhatBelongsTogetherAndNothingElse) {
  const fs::path folder = fresh_folder(), out = folder / "all.revisit";
  (void)drive(folder / "a", there, 61);
  (void)drive(folder / "b", there, 77);
  (void)drive(folder / "c", back, 61);
  const std::vector<fs::path> maps{folder / "a", folder / "b", folder / "c"};
  std::size_t last_done = 0, all = 0;
  std::size_t accepted = 0;
  const auto report = merge_maps(
      maps, out, {}, {},
      [&](std::size_t done, std::size_t of) {
        EXPECT_EQ(done, last_done + 1);
        last_done = done;
        all = of;
        return true;
      },
      [&](const Detection& detection) {
        if (detection.loop) {
          EXPECT_EQ(session_of(detection.loop->query), 2);
        }
        accepted += detection.loop ? 1 : 0;
        return ok();
      });
  EXPECT_GE(accepted, 6u);
  ASSERT_TRUE(report) << report.error().message;
  EXPECT_EQ(last_done, all);
  ASSERT_EQ(report->sessions.size(), 3u);
  EXPECT_EQ(report->sessions[2].map, 2u);
  EXPECT_EQ(report->sessions[0].parts, std::set{0});
  EXPECT_FALSE(report->sessions[1].parts.contains(0));
  EXPECT_EQ(report->sessions[2].parts, std::set{0});
  EXPECT_GE(report->sessions[2].loops, 6u);
  EXPECT_EQ(report->sessions[1].loops, 0u);
  const auto map = SavedMap::open(out);
  ASSERT_TRUE(map) << map.error().message;
  EXPECT_TRUE(map->store()->check());
  EXPECT_LT(off_m(*map, 0, there, 2, back), 0.3);
  EXPECT_EQ(map->store()->scans()->size(), 3u * kSessionScans);
  const auto ups = map->store()->ups();
  ASSERT_EQ(ups->size(), 3u) << "where gravity pulled comes along";
  for (int session = 0; session < 3; ++session) EXPECT_EQ(session_of((*ups)[session].keyframe), session);

  EXPECT_FALSE(merge_maps(maps, out)) << "exists already";
}

// Joined by what both saw, the rest of the second map comes along: what it saw alone, and its own further session.
TEST(MergeMaps, WhatLeavesTheOverlapComesAlong) {
  const fs::path folder = fresh_folder(), out = folder / "all.revisit";
  const PoseOf leaving = [](int i) { return SyntheticWorld::at(10.0 - kSessionStep_m * i, 0.8, kPi); };
  const PoseOf beyond = [](int i) { return SyntheticWorld::at(-8.0 - 0.5 * i, 0.4, kPi); };
  (void)drive(folder / "a", there, 61);
  (void)drive(folder / "b", leaving, 61);
  const auto second = drive(folder / "b", beyond, 61, true);
  ASSERT_TRUE(second && second->is_joined());
  const std::vector<fs::path> maps{folder / "a", folder / "b"};
  const auto report = merge_maps(maps, out);
  ASSERT_TRUE(report) << report.error().message;
  ASSERT_EQ(report->sessions.size(), 3u);
  const auto map = SavedMap::open(out);
  ASSERT_TRUE(map) << map.error().message;
  for (const auto& each : report->sessions) EXPECT_EQ(each.parts, std::set{0}) << each.recording;
  EXPECT_LT(off_m(*map, 0, there, 1, leaving), 0.3);
  EXPECT_LT(off_m(*map, 0, there, 2, beyond), 0.3);
}

// The new file is there whole or not at all; the old ones stay as they are.
TEST(MergeMaps, WhatEndsEarlyLeavesNothing) {
  const fs::path folder = fresh_folder(), out = folder / "all.revisit";
  (void)drive(folder / "a", there, 61);
  const std::vector<fs::path> maps{folder / "a", folder / "a"};
  const auto stopped = merge_maps(maps, out, {}, {}, [](std::size_t done, std::size_t) { return done < 30; });
  ASSERT_FALSE(stopped);
  EXPECT_FALSE(fs::exists(out));
  EXPECT_FALSE(fs::exists(out.string() + ".part"));
  const std::vector<fs::path> missing{folder / "a", folder / "nowhere"};
  const auto nowhere = merge_maps(missing, out);
  ASSERT_FALSE(nowhere);
  EXPECT_NE(nowhere.error().message.find("nowhere"), std::string::npos);
  Parameters other;
  other.descriptor.sectors = 60;
  EXPECT_FALSE(merge_maps(maps, out, other));
  EXPECT_FALSE(fs::exists(out));
}

}  // namespace
}  // namespace revisit
