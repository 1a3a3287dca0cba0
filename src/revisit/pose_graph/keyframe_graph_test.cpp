// SPDX-License-Identifier: Apache-2.0
#include <revisit/pose_graph/keyframe_graph.hpp>

#include <stdexcept>

#include <gtest/gtest.h>

namespace revisit {
namespace {

constexpr int kKeyframes = 40;

// Out along x for 20 m and back, as odometry that is 5 % too long sees it.
struct OutAndBack {
  OutAndBack() {
    TrajectoryPoint point;
    for (int i = 0; i < kKeyframes; ++i) {
      if (i == 0) {
        graph.add_keyframe({0}, point, std::nullopt);
        continue;
      }
      const double scale = i < kKeyframes / 2 ? 1.05 : 1.0;
      const Pose T = i == kKeyframes / 2 ? planar_pose(0, 0, kPi) : planar_pose(scale, 0, 0);
      point = point.after(T);
      graph.add_keyframe({i}, point, KeyframeGraph::OdometryEdge{T, 100.0 * Matrix6::Identity()});
    }
  }
  // The way back passes the places of the way out, heading the other way.
  static LoopConstraint loop(int query) {
    LoopConstraint loop;
    loop.query = {query};
    loop.match = {kKeyframes - 1 - query};
    loop.T_match_query = planar_pose(0, 0, kPi);
    loop.probability = 0.99;
    loop.information = 1e4 * Matrix6::Identity();
    return loop;
  }
  KeyframeGraph graph;
};

TEST(KeyframeGraph, LoopsThatAgreeMoveTheKeyframes) {
  OutAndBack drive;
  const double before_m = drive.graph.T_world_lidar({kKeyframes - 1}).translation().norm();
  EXPECT_NEAR(before_m, 0.95, 1e-9) << "19 m out, times 1.05, and 19 m back";
  EXPECT_TRUE(drive.graph.offer(OutAndBack::loop(36)).empty()) << "alone it waits";
  const auto decisions = drive.graph.offer(OutAndBack::loop(38));
  ASSERT_EQ(decisions.size(), 2u);
  for (const auto& decision : decisions) {
    EXPECT_TRUE(decision.enters);
    EXPECT_FALSE(drive.graph.add_loop(decision.loop)) << "there is one segment only";
  }
  ASSERT_TRUE(drive.graph.settle());
  EXPECT_LT(drive.graph.T_world_lidar({38}).translation().norm(), 1.2);
  const Pose circle = drive.graph.T_world_lidar({1}).inverse() * drive.graph.T_world_lidar({38});
  EXPECT_LT(circle.translation().norm(), 0.05) << "the loop holds now";
}

TEST(KeyframeGraph, ASegmentIsAttachedByALoopIntoWhatWasBefore) {
  OutAndBack drive;
  EXPECT_FALSE(drive.graph.last_attached());
  TrajectoryPoint elsewhere{.segment = 1};
  const KeyframeGraph::OdometryEdge unknown{Pose::Identity(), 1e-4 * Matrix6::Identity()};
  drive.graph.add_keyframe({100}, elsewhere, unknown);
  ASSERT_TRUE(drive.graph.last_attached());
  EXPECT_EQ(*drive.graph.last_attached(), FrameId{kKeyframes - 1});
  drive.graph.add_keyframe({101}, elsewhere.after(planar_pose(1, 0, 0)),
                           KeyframeGraph::OdometryEdge{planar_pose(1, 0, 0), Matrix6::Identity()});
  LoopConstraint within = OutAndBack::loop(38);
  within.query = {101};
  within.match = {100};
  EXPECT_FALSE(drive.graph.add_loop(within)) << "a loop within the segment says nothing about the rest";
  EXPECT_FALSE(drive.graph.add_loop(OutAndBack::loop(kKeyframes - 1))) << "nor does one that ends before";
  within.match = {3};
  EXPECT_TRUE(drive.graph.add_loop(within));
  EXPECT_FALSE(drive.graph.last_attached());
}

TEST(KeyframeGraph, ASegmentIsAttachedByALoopToTheVeryLastBefore) {
  OutAndBack drive;
  drive.graph.add_keyframe({100}, {.segment = 1}, KeyframeGraph::OdometryEdge{});
  LoopConstraint loop = OutAndBack::loop(0);
  loop.match = {kKeyframes - 1};
  loop.query = {100};
  EXPECT_TRUE(drive.graph.add_loop(loop));
}

TEST(KeyframeGraph, OfTwoPartsTheLaterOneMovesToWhereTheLoopHasIt) {
  for (const bool is_turned : {false, true}) {
    OutAndBack drive;
    TrajectoryPoint point{.segment = 1};
    const KeyframeGraph::OdometryEdge step{planar_pose(1, 0, 0), Matrix6::Identity()};
    for (int i = 0; i < 3; ++i) {
      drive.graph.add_keyframe({100 + i}, point, step, i == 0 ? std::optional(planar_pose(500, 0, 2)) : std::nullopt);
      point = point.after(planar_pose(1, 0, 0));
    }
    EXPECT_TRUE(drive.graph.T_world_lidar({100}).isApprox(planar_pose(500, 0, 2))) << "where it is said to be";
    EXPECT_TRUE(drive.graph.T_world_lidar({101}).isApprox(planar_pose(500, 0, 2) * planar_pose(1, 0, 0)));
    LoopConstraint loop = OutAndBack::loop(0);
    const Pose T_3_101 = planar_pose(0.5, 0.2, 0.1), T_world_3 = drive.graph.T_world_lidar({3});
    loop.match = is_turned ? FrameId{101} : FrameId{3};
    loop.query = is_turned ? FrameId{3} : FrameId{101};
    loop.T_match_query = is_turned ? T_3_101.inverse() : T_3_101;
    EXPECT_EQ(drive.graph.part({101}), 1);
    drive.graph.add_loop(loop);
    EXPECT_EQ(drive.graph.part({101}), 0);
    EXPECT_TRUE(drive.graph.T_world_lidar({3}).isApprox(T_world_3));
    EXPECT_TRUE(drive.graph.T_world_lidar({101}).isApprox(T_world_3 * T_3_101));
    EXPECT_TRUE(drive.graph.T_world_lidar({102}).isApprox(T_world_3 * T_3_101 * planar_pose(1, 0, 0)));
  }
}

TEST(KeyframeGraph, SettlesAtTheLatestAfterTwentyKeyframes) {
  OutAndBack drive;
  const auto place = [&] { return drive.graph.T_world_lidar({kKeyframes - 1}).translation().eval(); };
  const Eigen::Vector3d before = place();
  ASSERT_TRUE(drive.graph.settle_if_due());
  EXPECT_EQ(place(), before) << "without loops there is nothing to settle";
  EXPECT_TRUE(drive.graph.is_settled());
  drive.graph.add_loop(OutAndBack::loop(38));
  EXPECT_FALSE(drive.graph.is_settled());
  ASSERT_TRUE(drive.graph.settle_if_due());
  EXPECT_NE(place(), before) << "40 key frames since";
  EXPECT_TRUE(drive.graph.is_settled());
  drive.graph.add_loop(OutAndBack::loop(36));
  TrajectoryPoint point = drive.graph.last_point();
  for (int more = 1; more <= 20; ++more) {
    ASSERT_TRUE(drive.graph.settle_if_due());
    EXPECT_FALSE(drive.graph.is_settled()) << more;
    point = point.after(planar_pose(1, 0, 0));
    drive.graph.add_keyframe({200 + more}, point,
                             KeyframeGraph::OdometryEdge{planar_pose(1, 0, 0), Matrix6::Identity()});
  }
  ASSERT_TRUE(drive.graph.settle_if_due());
  EXPECT_TRUE(drive.graph.is_settled());
}

TEST(KeyframeGraph, OneLoopIsSettledWhenAsked) {
  OutAndBack drive;
  drive.graph.add_loop(OutAndBack::loop(38));
  ASSERT_TRUE(drive.graph.settle());
  EXPECT_TRUE(drive.graph.is_settled());
  const Pose circle = drive.graph.T_world_lidar({1}).inverse() * drive.graph.T_world_lidar({38});
  EXPECT_LT(circle.translation().norm(), 0.1);
}

TEST(KeyframeGraph, ALoopThatContradictsTheOthersLosesItsWeight) {
  OutAndBack drive;
  for (const int query : {28, 30, 32, 34, 36, 38}) drive.graph.add_loop(OutAndBack::loop(query));
  LoopConstraint wrong = OutAndBack::loop(30);
  wrong.T_match_query = planar_pose(7.0, 0.0, 0.0);
  drive.graph.add_loop(wrong);
  ASSERT_TRUE(drive.graph.settle());
  const Pose circle = drive.graph.T_world_lidar({9}).inverse() * drive.graph.T_world_lidar({30});
  EXPECT_LT(circle.translation().norm(), 0.1);
}

// A loop of an earlier run joins the parts as it did; its key frames are moved unless they lie there already.
TEST(KeyframeGraph, ARestoredLoopMovesWhatIsNotPlaced) {
  for (const bool is_placed : {true, false}) {
    OutAndBack drive;
    drive.graph.add_keyframe({100}, {.segment = 1}, KeyframeGraph::OdometryEdge{}, planar_pose(500, 0, 2));
    LoopConstraint loop = OutAndBack::loop(0);
    loop.match = {3};
    loop.query = {100};
    drive.graph.restore_loop(loop, is_placed);
    EXPECT_EQ(drive.graph.part({100}), 0);
    const Pose T = is_placed ? planar_pose(500, 0, 2) : drive.graph.T_world_lidar({3}) * loop.T_match_query;
    EXPECT_TRUE(drive.graph.T_world_lidar({100}).isApprox(T, 1e-9)) << is_placed;
  }
}

TEST(KeyframeGraph, FixesPlaceThePartsOnTheEarth) {
  OutAndBack drive;
  const Pose T_earth_world = planar_pose(1000, -300, 0.7);
  std::vector<KeyframeGraph::Fix> fixes;
  for (int i = 0; i < kKeyframes / 2; ++i)
    fixes.push_back({{i}, T_earth_world * planar_pose(i, 0, 0).translation(), Eigen::Vector3d::Constant(0.1)});
  fixes.push_back({.keyframe = {999}});  // of a scan that is no key frame
  const auto placed = drive.graph.settle_on_earth(fixes, {});
  ASSERT_TRUE(placed) << placed.error().message;
  ASSERT_EQ(placed->size(), 1u);
  EXPECT_NEAR(yaw_of(placed->at(0)), 0.7, 0.02);
  EXPECT_NEAR((drive.graph.T_world_lidar({19}).translation() - drive.graph.T_world_lidar({0}).translation()).norm(),
              19.0, 0.3)
      << "odometry alone says 19.95";
}

TEST(KeyframeGraph, FixesPlaceALaterPartToo) {
  OutAndBack drive;
  TrajectoryPoint point{.segment = 1};
  std::vector<KeyframeGraph::Fix> fixes{{{0}, Eigen::Vector3d::Zero(), Eigen::Vector3d::Ones()}};
  for (int i = 0; i < 20; ++i) {
    drive.graph.add_keyframe({100 + i}, point, KeyframeGraph::OdometryEdge{planar_pose(1, 0, 0), Matrix6::Identity()},
                             i == 0 ? std::optional(planar_pose(500, 0, 2)) : std::nullopt);
    point = point.after(planar_pose(1, 0, 0));
    fixes.push_back({{100 + i}, planar_pose(200 + i, 40, 0).translation(), Eigen::Vector3d::Constant(0.1)});
  }
  const auto placed = drive.graph.settle_on_earth(fixes, {});
  ASSERT_TRUE(placed) << placed.error().message;
  ASSERT_EQ(placed->size(), 1u);
  ASSERT_TRUE(placed->contains(1)) << "part 0 has one fix";
  const Pose T = placed->at(1) * drive.graph.T_world_lidar({119});
  EXPECT_LT((T.translation() - Eigen::Vector3d(219, 40, 0)).norm(), 0.5);
}

// Two sessions along one level road, 1 m a key frame, whose odometry pitches evenly; each has its accelerometer, which
// is off by its own. Gravity takes the drift out of the height, and neither offset bends the road.
TEST(KeyframeGraph, GravityOfTwoSessions) {
  constexpr int kOfSession = 200, kAll = 2 * kOfSession;
  const auto frame_of = [](int i) { return in_map(i / kOfSession, {i}); };
  Pose step = planar_pose(1.0, 0.0, 0.0);
  step.rotate(Eigen::AngleAxisd(-to_radians(0.01), Eigen::Vector3d::UnitY()));
  Matrix6 information = Matrix6::Identity();
  information.diagonal() << 1e4, 1e4, 1e4, 8e6, 8e6, 8e6;
  KeyframeGraph graph;
  TrajectoryPoint point;
  std::vector<KeyframeGraph::Up> ups;
  for (int i = 0; i < kAll; ++i) {
    if (i > 0) point = point.after(step);
    graph.add_keyframe(frame_of(i), point,
                       i == 0 ? std::nullopt : std::optional(KeyframeGraph::OdometryEdge{step, information}));
    const double off = i < kOfSession ? 0.01 : -0.01;
    if (i % 4 == 0) ups.push_back({frame_of(i), Eigen::Vector3d(off, 0.5 * off, 1.0).normalized()});
  }
  const auto height_m = [&](int i) { return std::abs(graph.T_world_lidar(frame_of(i)).translation().z()); };
  ASSERT_TRUE(graph.settle_on_earth({}, {}));
  const double before_m = height_m(kAll - 1);
  EXPECT_GT(before_m, 10.0);
  ASSERT_TRUE(graph.settle_on_earth({}, ups));
  EXPECT_LT(height_m(kAll - 1), 0.3 * before_m);
  EXPECT_LT(height_m(kOfSession), 0.3 * before_m);
}

TEST(KeyframeGraph, MisuseThrows) {
  KeyframeGraph graph;
  EXPECT_THROW(graph.add_keyframe({0}, {}, KeyframeGraph::OdometryEdge{}), std::invalid_argument);
  graph.add_keyframe({5}, {}, std::nullopt);
  EXPECT_THROW(graph.add_keyframe({6}, {}, std::nullopt), std::invalid_argument);
  EXPECT_THROW(graph.add_keyframe({5}, {}, KeyframeGraph::OdometryEdge{}), std::invalid_argument);
}

}  // namespace
}  // namespace revisit
