// SPDX-License-Identifier: Apache-2.0
#include <revisit/store/map_store.hpp>

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
