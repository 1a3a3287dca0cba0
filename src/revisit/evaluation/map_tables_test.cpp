// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <revisit/evaluation/session_table.hpp>
#include <revisit/evaluation/waking_table.hpp>

namespace revisit {
namespace {

LocalisationRow answer(std::int64_t frame, FrameId match, const Pose& T_match_lidar) {
  LocalisationRow row;
  row.frame = {frame};
  row.status = "found";
  row.match = match;
  row.T_match_lidar = T_match_lidar;
  row.ms = 10.0;
  return row;
}

// A map of three key frames, 10 m apart, in its second session.
std::map<FrameId, Pose> three_keyframes() {
  std::map<FrameId, Pose> truth;
  for (int i = 0; i < 3; ++i) truth[in_map(1, {i})] = planar_pose(10.0 * i, 0, 0);
  return truth;
}

TEST(WakingTable, CountsWhatIsRightWhatIsFalseAndWhatIsOutside) {
  Trajectory queries;
  queries.entries[{0}] = {0.0, planar_pose(0.5, 1.0, 0.1)};
  queries.entries[{1}] = {0.1, planar_pose(11.0, 0, 0)};
  queries.entries[{2}] = {0.2, planar_pose(20.0, 0, 0)};
  queries.entries[{3}] = {0.3, planar_pose(100.0, 0, 0)};
  queries.entries[{4}] = {0.4, planar_pose(100.0, 50, 0)};
  LocalisationRow lost;
  lost.frame = {2};
  lost.status = "lost";
  LocalisationRow lost_outside = lost;
  lost_outside.frame = {4};
  const auto table = evaluate_waking(
      {answer(0, in_map(1, {0}), planar_pose(0.6, 1.0, 0.1)), answer(1, in_map(1, {1}), planar_pose(1.7, 0, 0)), lost,
       answer(3, in_map(1, {2}), planar_pose(80.0, 0, 0.0)), lost_outside},
      queries, three_keyframes(), {});
  EXPECT_EQ(table.scans, 5u);
  EXPECT_EQ(table.in_map, 3u);
  EXPECT_EQ(table.right, 1u);
  EXPECT_EQ(table.outside, 2u);
  EXPECT_EQ(table.answered, 3u);
  // 0.7 m off is false; the pose 80 m from the last key frame happens to be right, wherever it comes from.
  EXPECT_EQ(table.false_answers, 1u);
  EXPECT_EQ(table.false_frames, std::vector{FrameId{1}});
  EXPECT_NEAR(table.median_error_m, 0.0, 0.11);
  EXPECT_EQ(table.statuses.at("lost"), 2u);
}

TEST(SessionTable, FindsTheJoinThatIsWrong) {
  std::map<FrameId, MapKeyframe> keyframes;
  std::map<FrameId, Pose> truth;
  const auto drive = [&](int session, int part, const Pose& T_off) {
    for (int i = 0; i < 20; ++i) {
      const Pose T = planar_pose(2.0 * i, 0.1 * i * i, 0.0);
      truth[in_map(session, {i})] = T;
      keyframes[in_map(session, {i})] = {T_off * T, part};
    }
  };
  drive(0, 0, planar_pose(5, 5, 1.0));
  drive(1, 0, planar_pose(5.05, 5, 1.0));
  drive(2, 0, planar_pose(9, 5, 1.0));  // joined 4 m off
  drive(3, 3, planar_pose(70, 5, 2.0));
  const SessionTable table = evaluate_sessions(keyframes, truth);
  ASSERT_EQ(table.sessions.size(), 4u);
  EXPECT_EQ(table.joined, 3u);
  EXPECT_EQ(table.wrong_joins, 1u);
  EXPECT_TRUE(table.sessions[2].is_wrong);
  EXPECT_LT(table.sessions[1].ate_joined_m, 0.1);
  EXPECT_LT(table.ate_m.at(3), 1e-6);
  EXPECT_GT(table.ate_m.at(0), 0.5);
}

}  // namespace
}  // namespace revisit
