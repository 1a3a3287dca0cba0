// SPDX-License-Identifier: Apache-2.0
#include <revisit/store/map_store.hpp>

#include <cmath>
#include <csignal>
#include <fstream>
#include <optional>

#include <gtest/gtest.h>
#include <sqlite3.h>
#include <sys/wait.h>
#include <unistd.h>

namespace revisit {
namespace {

std::filesystem::path fresh_file(const std::string& name) {
  const auto file = std::filesystem::path(testing::TempDir()) / ("revisit_" + name + ".map");
  for (const char* ending : {"", "-wal", "-shm", "-journal"}) std::filesystem::remove(file.string() + ending);
  return file;
}

Pose some_pose(double x) {
  Pose T = planar_pose(x, 2.0, 0.3);
  T.rotate(Eigen::AngleAxisd(0.1, Eigen::Vector3d::UnitX()));
  return T;
}

StoredKeyframe keyframe(std::int64_t frame) {
  return {{frame}, 0.1 * static_cast<double>(frame), some_pose(1.0), false, Bytes(3, std::byte{7}), Bytes(5), {}};
}

TEST(MapStore, GivesBackWhatItWasGiven) {
  const auto file = fresh_file("whole");
  {
    auto store = MapStore::create(file);
    ASSERT_TRUE(store) << store.error().message;
    ASSERT_TRUE(store->add(keyframe(4)));
    ASSERT_TRUE(store->add(keyframe(9)));
    ASSERT_TRUE(store->add(StoredScan{{5}, {4}, 0.5, some_pose(2.0), some_pose(3.0), false}));
    StoredEdge edge{{4}, {9}, some_pose(4.0), 2.0 * Matrix6::Identity(), {}};
    ASSERT_TRUE(store->add(edge));
    edge.loop = LoopConstraint{{9}, {4}, edge.T_from_to, 0.8, 0.1, 0.99, 1.5, edge.information};
    ASSERT_TRUE(store->add(edge));
    ASSERT_TRUE(store->add(CandidateRow{{9}, FrameId{4}, 1.5, true, ""}));
    ASSERT_TRUE(store->add(CandidateRow{{10}, std::nullopt, 0.0, false, "no place like it"}));
    ASSERT_TRUE(store->set_state(Bytes(1000, std::byte{3})));
    ASSERT_TRUE(store->set_state(Bytes(900, std::byte{7})));
    ASSERT_TRUE(store->commit());
  }
  const auto store = MapStore::open(file);
  ASSERT_TRUE(store) << store.error().message;
  const auto keyframes = store->keyframes();
  ASSERT_TRUE(keyframes);
  ASSERT_EQ(keyframes->size(), 2u);
  EXPECT_EQ((*keyframes)[1].frame, FrameId{9});
  EXPECT_TRUE((*keyframes)[1].T_odom_lidar.isApprox(some_pose(1.0), 1e-12));
  EXPECT_EQ(*store->part({9}, MapStore::Part::kDescriptor), Bytes(3, std::byte{7}));
  EXPECT_TRUE(store->part({9}, MapStore::Part::kCloud)->empty());
  const auto scans = store->scans();
  ASSERT_TRUE(scans);
  ASSERT_EQ(scans->size(), 1u);
  EXPECT_EQ((*scans)[0].keyframe, FrameId{4});
  EXPECT_FALSE((*scans)[0].is_tracked);
  EXPECT_TRUE((*scans)[0].T_odom_lidar.isApprox(some_pose(3.0), 1e-12));
  const auto edges = store->edges();
  ASSERT_TRUE(edges);
  ASSERT_EQ(edges->size(), 2u);
  EXPECT_FALSE((*edges)[0].loop);
  ASSERT_TRUE((*edges)[1].loop);
  EXPECT_EQ((*edges)[1].loop->query, FrameId{9});
  EXPECT_EQ((*edges)[1].loop->rmse_m, 0.1);
  EXPECT_EQ((*edges)[1].information, 2.0 * Matrix6::Identity());
  const auto answers = store->answers();
  ASSERT_TRUE(answers);
  ASSERT_EQ(answers->size(), 2u);
  EXPECT_EQ((*answers)[0].match, FrameId{4});
  EXPECT_FALSE((*answers)[1].match);
  EXPECT_EQ((*answers)[1].reason, "no place like it");
  EXPECT_EQ(*store->state(), Bytes(900, std::byte{7})) << "the last one";
}

TEST(MapStore, GivesBackWhereOnTheEarthItIs) {
  auto store = MapStore::create_temporary();
  ASSERT_TRUE(store && store->add(keyframe(4)));
  const StoredFix fix{{4}, {.latitude_deg = 49.0, .longitude_deg = 8.4, .altitude_m = 115.0, .deviation_m = {1, 2, 3}}};
  ASSERT_TRUE(store->add(fix));
  const StoredEarth earth{1, -90.0, 180.0, -3.0, some_pose(2.0)};
  ASSERT_TRUE(store->set_earth({&earth, 1}) && store->set_earth({&earth, 1}));
  const auto fixes = store->fixes();
  ASSERT_TRUE(fixes) << fixes.error().message;
  ASSERT_EQ(fixes->size(), 1u);
  EXPECT_EQ((*fixes)[0].fix.longitude_deg, 8.4);
  EXPECT_EQ((*fixes)[0].fix.stamp_s, keyframe(4).stamp_s) << "the key frame's";
  EXPECT_EQ((*fixes)[0].fix.deviation_m, Eigen::Vector3d(1, 2, 3));
  const auto back = store->earth();
  ASSERT_TRUE(back) << back.error().message;
  ASSERT_EQ(back->size(), 1u) << "those of before are forgotten";
  EXPECT_EQ((*back)[0].altitude_m, -3.0);
  EXPECT_TRUE((*back)[0].T_earth_map.isApprox(some_pose(2.0), 1e-12));
}

TEST(MapStore, PlacesOnNoEarthAreDamage) {
  const auto refuses = [](auto change) {
    StoredFix fix{{4}, {.latitude_deg = 49.0, .longitude_deg = 8.4, .altitude_m = 115.0, .deviation_m = {1, 2, 3}}};
    StoredEarth earth{1, 49.0, 8.4, 115.0, Pose::Identity()};
    StoredUp up{{4}};
    change(fix, earth, up);
    auto store = MapStore::create_temporary();
    EXPECT_TRUE(store->add(keyframe(4)) && store->add(fix) && store->set_earth({&earth, 1}) && store->add(up));
    return !store->fixes() + 2 * !store->earth() + 4 * !store->ups();
  };
  EXPECT_EQ(refuses([](auto&, auto&, auto&) {}), 0);
  EXPECT_EQ(refuses([](auto& fix, auto& earth, auto&) { fix.fix.latitude_deg = earth.latitude_deg = 90.5; }), 3);
  EXPECT_EQ(refuses([](auto& fix, auto& earth, auto&) { fix.fix.longitude_deg = earth.longitude_deg = -181.0; }), 3);
  EXPECT_EQ(refuses([](auto& fix, auto& earth, auto&) { fix.fix.altitude_m = earth.altitude_m = INFINITY; }), 3);
  EXPECT_EQ(refuses([](auto& fix, auto&, auto&) { fix.fix.deviation_m.y() = 0.0; }), 1);
  EXPECT_EQ(refuses([](auto& fix, auto&, auto&) { fix.fix.deviation_m.y() = INFINITY; }), 1);
  EXPECT_EQ(refuses([](auto&, auto& earth, auto&) { earth.T_earth_map.translation().x() = 1e8; }), 2);
  EXPECT_EQ(refuses([](auto&, auto&, auto& up) { up.up *= 1.1; }), 4);
}

TEST(MapStore, MatricesAndPosesThatCannotBeAreDamage) {
  auto store = MapStore::create_temporary();
  StoredEdge edge{{4}, {9}, some_pose(4.0), 2.0 * Matrix6::Identity(), {}};
  edge.information(0, 1) = 1.0;
  ASSERT_TRUE(store && store->add(edge));
  const auto edges = store->edges();
  ASSERT_FALSE(edges) << "not symmetric";
  EXPECT_NE(edges.error().message.find("row 1 of its edges is damaged"), std::string::npos) << edges.error().message;
  StoredKeyframe far = keyframe(4);
  far.T_odom_lidar.translation().z() = -1e7;
  ASSERT_TRUE(store->add(far));
  EXPECT_FALSE(store->keyframes());
}

TEST(MapStore, TheIndexOfAFinishedMapGoesWithAnyChange) {
  const auto finished = [] {
    auto store = *MapStore::create_temporary();
    const StoredMapPose pose{{4}, some_pose(1.0), 2};
    EXPECT_TRUE(store.add(keyframe(4)) && store.add_index(0, Bytes(10, std::byte{1})) &&
                store.add_index(10, Bytes(5, std::byte{2})) && store.set_place_poses({&pose, 1}));
    return store;
  };
  const MapStore store = finished();
  EXPECT_EQ(*store.index_size(), 15u);
  Bytes piece(5);
  ASSERT_TRUE(store.read_index(10, piece));
  EXPECT_EQ(piece, Bytes(5, std::byte{2}));
  EXPECT_FALSE(store.read_index(9, piece)) << "no piece begins there";
  EXPECT_FALSE(store.read_index(0, piece)) << "that one is longer";
  ASSERT_EQ(store.place_poses()->size(), 1u);
  EXPECT_EQ(store.place_poses()->at(0).part, 2);
  EXPECT_TRUE(store.place_poses()->at(0).T_map_lidar.isApprox(some_pose(1.0), 1e-12));
  for (const int change : {0, 1, 2}) {
    MapStore changed = finished();
    const FrameId frame{4};
    ASSERT_TRUE(change == 0   ? changed.add(keyframe(5))
                : change == 1 ? changed.set_map_poses({})
                              : changed.remove({&frame, 1}, {}));
    EXPECT_EQ(*changed.index_size(), 0u) << change;
    EXPECT_TRUE(changed.place_poses()->empty());
    EXPECT_FALSE(changed.read_index(0, piece));
  }
}

TEST(MapStore, AKeyFrameIsTakenOutWithAllThatBelongsToIt) {
  auto store = MapStore::create_temporary();
  ASSERT_TRUE(store);
  for (const int frame : {4, 9, 14}) {
    ASSERT_TRUE(store->add(keyframe(frame)));
    ASSERT_TRUE(store->add(StoredScan{{frame + 1}, {frame}, 0.5, some_pose(2.0), some_pose(3.0), true}));
    ASSERT_TRUE(store->add(StoredUp{{frame}}));
    ASSERT_TRUE(store->add_visit({frame}, Bytes(3)));
    if (frame > 4) {
      ASSERT_TRUE(store->add(StoredEdge{{frame - 5}, {frame}, some_pose(1.0), Matrix6::Identity(), {}}));
    }
  }
  const FrameId frame{9};
  const MapStore::Joint joint{{{4}, {14}, some_pose(2.0), Matrix6::Identity(), {}}, true};
  ASSERT_TRUE(store->remove({&frame, 1}, {&joint, 1}));
  ASSERT_EQ(store->keyframes()->size(), 2u);
  EXPECT_TRUE(store->keyframes()->at(1).starts_segment) << "as the joint says";
  EXPECT_EQ(store->scans()->size(), 2u);
  EXPECT_EQ(store->ups()->size(), 2u);
  EXPECT_EQ(*store->visits(), (std::vector<FrameId>{{4}, {14}}));
  EXPECT_EQ(*store->places(), (std::vector<FrameId>{{4}, {14}}));
  ASSERT_EQ(store->edges()->size(), 1u);
  EXPECT_EQ(store->edges()->at(0).from, FrameId{4});
  EXPECT_FALSE(store->part({9}, MapStore::Part::kCloud));
  EXPECT_FALSE(*store->has({9}));
  EXPECT_TRUE(*store->has({14}));
  ASSERT_TRUE(store->check()) << store->check().error().message;
  ASSERT_TRUE(store->forget_visits());
  EXPECT_TRUE(store->visits()->empty());
}

TEST(MapStore, WhatIsRolledBackWasNever) {
  auto store = MapStore::create_temporary();
  ASSERT_TRUE(store && store->add(keyframe(1)));
  EXPECT_TRUE(store->is_held()) << "something waits";
  ASSERT_TRUE(store->commit());
  EXPECT_FALSE(store->is_held());
  ASSERT_TRUE(store->add(keyframe(2)) && store->roll_back());
  EXPECT_EQ(store->keyframes()->size(), 1u);
  EXPECT_TRUE(store->commit() && store->roll_back()) << "nothing to do";
}

// Whatever ends the program: what was committed is there, what was not is not.
TEST(MapStore, SurvivesAKill) {
  const auto file = fresh_file("killed");
  const pid_t child = fork();
  if (child == 0) {
    auto store = MapStore::create(file);
    bool fine = store && store->add(keyframe(1)) && store->commit() && store->add(keyframe(2));
    ::kill(getpid(), fine ? SIGKILL : SIGTERM);
  }
  int how = 0;
  waitpid(child, &how, 0);
  ASSERT_TRUE(WIFSIGNALED(how));
  ASSERT_EQ(WTERMSIG(how), SIGKILL);
  auto store = MapStore::open(file);
  ASSERT_TRUE(store) << store.error().message;
  const auto keyframes = store->keyframes();
  ASSERT_TRUE(keyframes);
  ASSERT_EQ(keyframes->size(), 1u);
  EXPECT_EQ((*keyframes)[0].frame, FrameId{1});
  EXPECT_TRUE(store->add(keyframe(2)));
}

// Killed before its write-ahead log began, a writer leaves a rollback journal: a reader may not take it back by itself.
TEST(MapStore, AReaderFindsTheMapWholeAfterAKillWithoutALog) {
  const auto file = fresh_file("journal");
  {
    auto store = MapStore::create(file);
    ASSERT_TRUE(store && store->add(keyframe(1)) && store->set(StoredSession{0, "before", "", ""}) && store->commit());
  }
  const pid_t child = fork();
  if (child == 0) {
    sqlite3* raw = nullptr;
    sqlite3_open(file.c_str(), &raw);
    sqlite3_exec(raw, "PRAGMA journal_mode=DELETE; BEGIN; UPDATE sessions SET recording='half done'", nullptr, nullptr,
                 nullptr);
    sqlite3_db_cacheflush(raw);
    ::kill(getpid(), SIGKILL);
  }
  int how = 0;
  waitpid(child, &how, 0);
  ASSERT_TRUE(std::filesystem::exists(file.string() + "-journal"));
  const auto store = MapStore::open(file, MapStore::Access::kRead);
  ASSERT_TRUE(store) << store.error().message;
  EXPECT_EQ(store->sessions()->at(0).recording, "before");
  EXPECT_EQ(store->keyframes()->size(), 1u);
}

TEST(MapStore, OneWriterAtATimeAndAnyNumberOfReaders) {
  const auto file = fresh_file("written");
  std::optional<MapStore> first;
  {
    auto created = MapStore::create(file);
    ASSERT_TRUE(created && created->add(keyframe(1)) && created->commit());
    first = *std::move(created);
  }
  const auto second = MapStore::open(file);
  ASSERT_FALSE(second);
  EXPECT_NE(second.error().message.find("another program writes this map"), std::string::npos)
      << second.error().message;
  const auto reader = MapStore::open(file, MapStore::Access::kRead);
  ASSERT_TRUE(reader) << reader.error().message;
  EXPECT_EQ(reader->keyframes()->size(), 1u);
  EXPECT_FALSE(MapStore::remove_file(file));
  EXPECT_FALSE(MapStore::create(file));
  EXPECT_EQ(reader->keyframes()->size(), 1u) << "it is still there";
  first.reset();
  EXPECT_TRUE(MapStore::open(file));
  EXPECT_FALSE(std::filesystem::exists(file.string() + ".lock"));
  EXPECT_TRUE(MapStore::remove_file(file));
  EXPECT_FALSE(std::filesystem::exists(file));
}

TEST(MapStore, RefusesWhatIsNoMap) {
  EXPECT_FALSE(MapStore::open(fresh_file("absent")));
  const auto text = fresh_file("text");
  std::ofstream(text) << std::string(5000, 'x');
  const auto opened = MapStore::open(text);
  ASSERT_FALSE(opened);
  EXPECT_NE(opened.error().message.find(text.string()), std::string::npos);
  const auto existing = MapStore::create(text);
  ASSERT_FALSE(existing);
  EXPECT_NE(existing.error().message.find("exists"), std::string::npos);
  EXPECT_FALSE(MapStore::open(testing::TempDir()));
}

TEST(MapStore, SameFrameTwiceIsAnError) {
  auto store = MapStore::create(fresh_file("twice"));
  ASSERT_TRUE(store);
  ASSERT_TRUE(store->add(keyframe(1)));
  EXPECT_FALSE(store->add(keyframe(1)));
  EXPECT_FALSE(store->part({7}, MapStore::Part::kPlace));
}

}  // namespace
}  // namespace revisit
