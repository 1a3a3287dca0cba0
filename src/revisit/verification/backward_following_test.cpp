// SPDX-License-Identifier: Apache-2.0
#include <revisit/verification/backward_following.hpp>

#include <gtest/gtest.h>

namespace revisit {
namespace {

BackwardFollowing::Query refused(int frame, int segment = 1) {
  TrajectoryPoint point{.segment = segment, .travelled_m = static_cast<double>(frame)};
  point.T_segment_lidar = planar_pose(frame, 0, 0);
  return {FrameId{frame}, FrameId{50}, 51, point, {}};
}

void add_loop(BackwardFollowing& backward, int frame) {
  const TrajectoryPoint place{.segment = 1};
  backward.add_loop(refused(frame).point, FrameId{0}, place, Pose::Identity(), 9.0);
}

TEST(BackwardFollowing, NothingIsTestedBeforeALoop) {
  BackwardFollowing backward;
  backward.add_refused(refused(100));
  EXPECT_FALSE(backward.next());
}

TEST(BackwardFollowing, ALoopLeadsBackFromTheNewestToTheOldest) {
  BackwardFollowing backward;
  for (const int frame : {100, 101, 102}) backward.add_refused(refused(frame));
  backward.open_refused();
  add_loop(backward, 103);
  backward.add_refused(refused(104));
  EXPECT_EQ(backward.next()->frame, FrameId{102});
  EXPECT_TRUE(backward.loops().predict(refused(101).point, {{FrameId{0}, TrajectoryPoint{.segment = 1}}}, FrameId{50}));
  EXPECT_EQ(backward.next()->frame, FrameId{101});
  EXPECT_EQ(backward.next()->frame, FrameId{100});
  EXPECT_FALSE(backward.next()) << "104 came after the loop";
  backward.open_refused();
  EXPECT_EQ(backward.next()->frame, FrameId{104}) << "until the next one";
}

TEST(BackwardFollowing, OutOfReachOfAllLoopsItStops) {
  BackwardFollowing backward;
  for (const int frame : {100, 101, 102}) backward.add_refused(refused(frame));
  backward.open_refused();
  EXPECT_TRUE(backward.next());
  backward.stop();
  EXPECT_FALSE(backward.next());
}

TEST(BackwardFollowing, QueriesBeforeALossOfTrackAndLongAgoAreForgotten) {
  BackwardFollowing backward;
  backward.add_refused(refused(100, 1));
  for (int frame = 101; frame < 401; ++frame) backward.add_refused(refused(frame, 2));
  backward.open_refused();
  int kept = 0, oldest = 0;
  while (const auto query = backward.next()) {
    ++kept;
    oldest = static_cast<int>(query->frame.value);
  }
  EXPECT_EQ(kept, 200);
  EXPECT_EQ(oldest, 201);
}

}  // namespace
}  // namespace revisit
