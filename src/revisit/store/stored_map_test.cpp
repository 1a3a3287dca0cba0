// SPDX-License-Identifier: Apache-2.0
#include <revisit/store/stored_map.hpp>

#include <limits>

#include <gtest/gtest.h>

#include <revisit/store/keyframe_bytes.hpp>

#include "random_points.hpp"

namespace revisit {
namespace {

// Five key frames, a metre and two frames apart; before the fourth one tracking was lost. A loop joins the last to the
// first. Rows are written by hand, so that each may be wrong.
class StoredMapTest : public testing::Test {
 protected:
  StoredMapTest() : store_(*MapStore::create_temporary()) {
    for (int i = 0; i < 5; ++i) {
      keyframes_.push_back({{2 * i}, 0.2 * i, planar_pose(i < 3 ? i : i - 3, 0, 0), i == 3, {}, {}, {}});
      if (i > 0) edges_.push_back({{2 * i - 2}, {2 * i}, planar_pose(1, 0, 0), 4.0 * Matrix6::Identity(), {}});
      poses_.push_back({{2 * i}, planar_pose(i, 1, 0), 0});
    }
    LoopConstraint loop;
    loop.query = FrameId{8};
    loop.match = FrameId{0};
    loop.T_match_query = planar_pose(4, 0, 0);
    edges_.push_back({{0}, {8}, loop.T_match_query, Matrix6::Identity(), loop});
  }
  Result<StoredMap> read() {
    for (const StoredSession& each : sessions_) EXPECT_TRUE(store_.set(each));
    for (const StoredKeyframe& each : keyframes_) EXPECT_TRUE(store_.add(each));
    for (const StoredEdge& each : edges_) EXPECT_TRUE(store_.add(each));
    EXPECT_TRUE(store_.set_map_poses(poses_));
    EXPECT_TRUE(store_.commit());
    return read_map(store_);
  }
  void expect_refused(const std::string& why) {
    const auto map = read();
    ASSERT_FALSE(map);
    EXPECT_NE(map.error().message.find(why), std::string::npos) << map.error().message;
    EXPECT_FALSE(store_.is_held()) << "it is let go of all the same";
  }

  MapStore store_;
  std::vector<StoredSession> sessions_{{0, "drive.bag", "", ""}};
  std::vector<StoredKeyframe> keyframes_;
  std::vector<StoredEdge> edges_;
  std::vector<StoredMapPose> poses_;
};

TEST_F(StoredMapTest, IsWhatTheRowsSayPutTogether) {
  poses_.pop_back();  // the last key frame came after the graph was settled
  const auto map = read();
  ASSERT_TRUE(map) << map.error().message;
  ASSERT_EQ(map->keyframes.size(), 5u);
  EXPECT_FALSE(map->keyframes[0].edge);
  EXPECT_EQ(map->keyframes[1].edge->information, 4.0 * Matrix6::Identity());
  EXPECT_DOUBLE_EQ(map->keyframes[2].point.travelled_m, 2.0);
  EXPECT_EQ(map->keyframes[2].point.segment, 0);
  EXPECT_EQ(map->keyframes[3].point.segment, 1) << "tracking was lost";
  EXPECT_EQ(map->keyframes[3].point.origin, 1);
  EXPECT_DOUBLE_EQ(map->keyframes[4].point.travelled_m, 1.0);
  EXPECT_TRUE(map->keyframes[3].settled);
  EXPECT_FALSE(map->keyframes[4].settled);
  ASSERT_EQ(map->loops.size(), 1u);
  EXPECT_EQ(map->loops[0].query, FrameId{8});
}

TEST_F(StoredMapTest, ASettledGraphIsLeftAsItIs) {
  const auto map = read();
  ASSERT_TRUE(map);
  KeyframeGraph graph;
  ASSERT_TRUE(restore_graph(*map, graph));
  EXPECT_TRUE(graph.is_settled());
  for (const StoredMapPose& each : poses_)
    EXPECT_TRUE(graph.T_world_lidar(each.keyframe).isApprox(each.T_map_lidar)) << each.keyframe.value;
}

TEST_F(StoredMapTest, AGraphThatWasNotSettledIsSettled) {
  poses_.clear();
  const auto map = read();
  ASSERT_TRUE(map);
  KeyframeGraph graph;
  ASSERT_TRUE(restore_graph(*map, graph));
  EXPECT_TRUE(graph.is_settled());
  EXPECT_EQ(graph.part({8}), 0) << "the loop joins what was lost";
  EXPECT_TRUE(graph.T_world_lidar({8}).isApprox(planar_pose(4, 0, 0), 1e-3));
}

TEST_F(StoredMapTest, AnEmptyMapIsOne) {
  sessions_.clear(), keyframes_.clear(), edges_.clear(), poses_.clear();
  const auto map = read();
  ASSERT_TRUE(map) << map.error().message;
  EXPECT_TRUE(map->keyframes.empty());
}

TEST_F(StoredMapTest, KeyFramesWithoutTheirEdgesAreRefused) {
  edges_.erase(edges_.begin() + 1);
  expect_refused("key frame 4 of the map does not follow");
}

TEST_F(StoredMapTest, AnEdgeIntoTheFirstKeyFrameIsRefused) {
  edges_.push_back({{2}, {0}, planar_pose(1, 0, 0), Matrix6::Identity(), {}});
  expect_refused("key frame 0 of the map does not follow");
}

TEST_F(StoredMapTest, AnEdgeFromElsewhereIsRefused) {
  edges_[2].from = FrameId{0};
  expect_refused("key frame 6 of the map does not follow");
}

TEST_F(StoredMapTest, ATimeThatIsNoneIsRefused) {
  keyframes_[1].stamp_s = std::numeric_limits<double>::infinity();
  expect_refused("time or beginning of key frame 2 is damaged");
}

TEST_F(StoredMapTest, TheFirstKeyFrameCannotHaveLostTrack) {
  keyframes_[0].starts_segment = true;
  expect_refused("time or beginning of key frame 0 is damaged");
}

TEST_F(StoredMapTest, SessionsAreNumbered) {
  sessions_.push_back({2, "", "", ""});
  expect_refused("one has the number 2");
}

TEST_F(StoredMapTest, KeyFramesOfNoSessionAreRefused) {
  sessions_.clear();
  expect_refused("a session that it does not know");
}

TEST_F(StoredMapTest, KeyFramesOfALaterSessionAreRefused) {
  keyframes_.push_back({in_map(1, {0}), 2.0, Pose::Identity(), true, {}, {}, {}});
  edges_.push_back({{8}, in_map(1, {0}), Pose::Identity(), Matrix6::Identity(), {}});
  expect_refused("a session that it does not know");
}

TEST_F(StoredMapTest, ANegativeFrameIsRefused) {
  keyframes_[0].frame = edges_[0].from = FrameId{-1};
  poses_.clear();
  expect_refused("has the number -1");
}

TEST_F(StoredMapTest, APoseOfNoKeyFrameIsRefused) {
  poses_[1].keyframe = FrameId{3};
  expect_refused("a pose for frame 3");
}

TEST_F(StoredMapTest, ALoopToNoKeyFrameIsRefused) {
  edges_.back().from = FrameId{1};
  expect_refused("a loop of the map names frame 8");
}

TEST_F(StoredMapTest, ALoopToItselfIsRefused) {
  edges_.back().from = FrameId{8};
  expect_refused("a loop of the map names frame 8");
}

TEST_F(StoredMapTest, PlacesComeBackWhereTheyWereDescribed) {
  const DescriptorOptions grid;
  const IntensityScanContext descriptor = describe(testing_support::random_points(500, 3), grid);
  keyframes_[1].descriptor = keyframes_[4].descriptor = to_bytes(descriptor);
  const auto map = read();
  ASSERT_TRUE(map);
  std::vector<std::int64_t> restored;
  const auto restore = [&](const StoredMap::Keyframe& keyframe, const IntensityScanContext& found) {
    restored.push_back(keyframe.frame.frame.value);
    EXPECT_EQ(found.intensity, descriptor.intensity);
  };
  ASSERT_TRUE(restore_places(store_, *map, grid, restore));
  EXPECT_EQ(restored, (std::vector<std::int64_t>{2, 8}));
  for (int DescriptorOptions::*of :
       {&DescriptorOptions::rings, &DescriptorOptions::sectors, &DescriptorOptions::levels}) {
    DescriptorOptions other;
    other.*of += 1;
    const Status refused = restore_places(store_, *map, other, restore);
    ASSERT_FALSE(refused);
    EXPECT_NE(refused.error().message.find("on a grid of 20 x 30 x 4 cells"), std::string::npos);
  }
}

TEST_F(StoredMapTest, ADamagedDescriptorIsNamed) {
  keyframes_[2].descriptor = Bytes(10, std::byte{1});
  const auto map = read();
  ASSERT_TRUE(map);
  const Status status = restore_places(store_, *map, {}, [](const auto&, const auto&) {});
  ASSERT_FALSE(status);
  EXPECT_NE(status.error().message.find("the descriptor of key frame 4 is damaged"), std::string::npos);
}

TEST(PointInMap, PartsOfTheMapAreApartFromWhatOdometryCounts) {
  const TrajectoryPoint first = point_in_map(planar_pose(1, 2, 0), 0), second = point_in_map(planar_pose(3, 2, 0), 1);
  EXPECT_LT(first.segment, 0);
  EXPECT_NE(first.segment, second.segment);
  EXPECT_NE(first.origin, second.origin);
  EXPECT_EQ(first.segment, point_in_map(Pose::Identity(), 0).segment);
  EXPECT_TRUE(first.T_segment_lidar.isApprox(planar_pose(1, 2, 0)));
}

}  // namespace
}  // namespace revisit
