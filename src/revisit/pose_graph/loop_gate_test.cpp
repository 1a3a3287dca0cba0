// SPDX-License-Identifier: Apache-2.0
#include <revisit/pose_graph/loop_gate.hpp>

#include <optional>
#include <stdexcept>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

namespace revisit {
namespace {

// Out along x, a key frame a metre, and the same way again from frame 1000 on, as odometry sees it: 2 % too long.
LoopGate gate_of_two_visits() {
  LoopGate gate;
  TrajectoryPoint point;
  const auto add = [&](int frame, const Pose& T_odom_lidar) {
    if (frame > 0) point = point.after(point.T_segment_lidar.inverse() * T_odom_lidar);
    gate.add_keyframe({frame}, point);
  };
  for (int i = 0; i < 100; ++i) add(i, planar_pose(i, 0, 0));
  for (int i = 0; i < 100; ++i) add(1000 + i, planar_pose(1.01 * i, 5, 0));
  return gate;
}

LoopConstraint loop(int query, int match, double x_m, double probability = 0.97) {
  return {{query}, {match}, planar_pose(x_m, 0, 0), 0.8, 0.1, probability, 1.0, Matrix6::Identity()};
}

TEST(LoopGate, ALoopWaitsUntilAnotherAgrees) {
  LoopGate gate = gate_of_two_visits();
  EXPECT_TRUE(gate.offer(loop(1010, 10, 0.2)).empty());
  const auto decisions = gate.offer(loop(1012, 12, 0.1));
  ASSERT_EQ(decisions.size(), 2u);
  EXPECT_EQ(decisions[0].loop.query, FrameId{1010});
  EXPECT_TRUE(decisions[0].enters && decisions[1].enters);
  EXPECT_EQ(decisions[0].agreeing, 1u);
  EXPECT_EQ(decisions[1].agreeing, 1u);
  EXPECT_TRUE(gate.decide_all().empty());
}

TEST(LoopGate, LoopsThatContradictDoNotLetEachOtherIn) {
  LoopGate gate = gate_of_two_visits();
  EXPECT_TRUE(gate.offer(loop(1010, 10, 0.2)).empty());
  EXPECT_TRUE(gate.offer(loop(1012, 30, 0.1)).empty()) << "18 m off";
  for (const auto& decision : gate.decide_all()) EXPECT_FALSE(decision.enters);
}

// By 4.02 m of odometry between them, loops may be off by 0.5 m and 2 in a hundred, 3 degrees and 0.05 a metre.
TEST(LoopGate, LoopsAgreeWithinWhatOdometryIsOff) {
  const auto agree = [](double off_m, double off_deg) {
    LoopGate gate = gate_of_two_visits();
    EXPECT_TRUE(gate.offer(loop(1010, 10, 0.0)).empty());
    LoopConstraint second = loop(1012, 12, 0.0);
    second.T_match_query = planar_pose(off_m, 0, to_radians(off_deg));
    return !gate.offer(second).empty();
  };
  // Odometry is 2 cm longer between the queries than between the matches.
  EXPECT_TRUE(agree(0.59, 0));
  EXPECT_FALSE(agree(0.61, 0));
  EXPECT_TRUE(agree(-0.55, 0));
  EXPECT_FALSE(agree(-0.57, 0));
  EXPECT_TRUE(agree(0, 3.15));
  EXPECT_FALSE(agree(0, 3.25));
}

TEST(LoopGate, LoopsFarFromEachOtherAreNotCompared) {
  for (const int apart : {38, 42}) {  // of queries and matches together, 80 m
    LoopGate gate = gate_of_two_visits();
    EXPECT_TRUE(gate.offer(loop(1010, 10, 0.0)).empty());
    EXPECT_EQ(gate.offer(loop(1010 + apart, 10 + apart, 0.0)).size(), apart < 40 ? 2u : 0u) << apart;
  }
}

TEST(LoopGate, CountsThoseThatAgreeAndRemembersWhatEntered) {
  LoopGate gate = gate_of_two_visits();
  gate.restore(loop(1008, 8, 0.0));
  gate.restore(loop(1010, 10, 0.0));
  gate.restore(loop(1012, 40, 0.0));
  const auto third = gate.offer(loop(1012, 12, 0.0));
  ASSERT_EQ(third.size(), 1u);
  EXPECT_TRUE(third[0].enters);
  EXPECT_EQ(third[0].agreeing, 2u);
  EXPECT_TRUE(gate.has(FrameId{1099}));
  EXPECT_TRUE(gate.has(FrameId{0}));
  EXPECT_FALSE(gate.has(FrameId{1100}));
  EXPECT_FALSE(gate.has(FrameId{500}));
  EXPECT_EQ(gate.keyframes(), 200u);
}

TEST(LoopGate, AloneOnlyTheSureEnter) {
  LoopGate gate = gate_of_two_visits();
  EXPECT_TRUE(gate.offer(loop(1010, 10, 0.2, 0.9995)).empty());
  EXPECT_TRUE(gate.offer(loop(1090, 90, 0.2, 0.98)).empty()) << "too far for odometry to compare them";
  const auto passed = gate.decide_overdue();
  ASSERT_EQ(passed.size(), 1u) << "the newest key frame is only 9 m beyond the second one";
  EXPECT_TRUE(passed[0].enters);
  EXPECT_EQ(passed[0].agreeing, 0u);
  const auto rest = gate.decide_all();
  ASSERT_EQ(rest.size(), 1u);
  EXPECT_FALSE(rest[0].enters);
}

// Loops that were followed backwards come after newer ones.
TEST(LoopGate, AnOlderLoopIsDueBeforeANewerOneThatWaitsLonger) {
  LoopGate gate = gate_of_two_visits();
  EXPECT_TRUE(gate.offer(loop(1090, 90, 0.2, 0.98)).empty());
  EXPECT_TRUE(gate.offer(loop(1010, 10, 0.2, 0.9995)).empty());
  const auto passed = gate.decide_overdue();
  ASSERT_EQ(passed.size(), 1u);
  EXPECT_EQ(passed[0].loop.query, FrameId{1010});
}

TEST(LoopGate, SureOfItselfButAgainstTheOthers) {
  LoopGate gate = gate_of_two_visits();
  EXPECT_TRUE(gate.offer(loop(1010, 10, 0.2)).empty());
  EXPECT_EQ(gate.offer(loop(1012, 12, 0.1)).size(), 2u);
  EXPECT_TRUE(gate.offer(loop(1014, 30, 0.1, 0.9999)).empty());
  const auto rest = gate.decide_all();
  ASSERT_EQ(rest.size(), 1u);
  EXPECT_FALSE(rest[0].enters);
}

TEST(LoopGate, WhatEnteredAloneCountsAgainstLaterOnes) {
  LoopGate gate = gate_of_two_visits();
  EXPECT_TRUE(gate.offer(loop(1010, 10, 0.2, 0.9995)).empty());
  ASSERT_EQ(gate.decide_all().size(), 1u);
  EXPECT_TRUE(gate.offer(loop(1014, 30, 0.1, 0.9999)).empty()) << "16 m off";
  const auto later = gate.decide_all();
  ASSERT_EQ(later.size(), 1u);
  EXPECT_FALSE(later[0].enters);
}

TEST(LoopGate, NothingIsComparedAcrossALossOfTrack) {
  LoopGate gate;
  for (int i = 0; i < 20; ++i) gate.add_keyframe({i}, {0, planar_pose(i, 0, 0), 1.0 * i});
  for (int i = 0; i < 20; ++i)
    gate.add_keyframe({1000 + i}, {i < 11 ? 0 : 1, planar_pose(i, 5, 0), i < 11 ? 20.0 + i : i - 11.0});
  EXPECT_TRUE(gate.offer(loop(1010, 10, 0.2)).empty());
  EXPECT_TRUE(gate.offer(loop(1012, 12, 0.1)).empty());
  EXPECT_EQ(gate.offer(loop(1014, 14, 0.1)).size(), 2u);
}

// A second session along the same way is joined by its first 24 m; after `lost_at` metres it loses track, and
// goes on `gap_m` later.
LoopGate gate_that_lost_track(double gap_m, int lost_at = 50) {
  LoopGate gate;
  TrajectoryPoint point;
  for (int i = 0; i < 140; ++i) {
    point = i == 0 ? point : point.after(planar_pose(1, 0, 0));
    gate.add_keyframe({i}, point);
  }
  for (int i = 0; i < lost_at + 30; ++i) {
    if (i == 0 || i == lost_at)
      point = TrajectoryPoint{.segment = point.segment + 1, .origin = point.segment + 1};
    else
      point = point.after(planar_pose(1, 0, 0));
    gate.add_keyframe(in_map(1, {i}), point);
  }
  for (int i = 0; i <= 24; i += 4) {
    LoopConstraint joins = loop(0, i, 0.0);
    joins.query = in_map(1, {i});
    for (const auto& decision : gate.offer(joins)) gate.join(decision.loop);
  }
  for (int i = lost_at; i < lost_at + 30; ++i) {
    const int whole_m = static_cast<int>(gap_m);
    LoopConstraint after = loop(0, i + whole_m, gap_m - whole_m);
    after.query = in_map(1, {i});
    if ((i - lost_at) % 3 == 1 && i < lost_at + 13)
      for (const auto& decision : gate.offer(after)) gate.join(decision.loop);
  }
  return gate;
}

// Two sessions, 59 m each, a key frame every metre; nothing is known of how they lie to each other.
LoopGate gate_of_two_sessions() {
  LoopGate gate;
  for (int session = 0; session < 2; ++session) {
    TrajectoryPoint point{.segment = session, .origin = session};
    for (int i = 0; i < 60; ++i) {
      gate.add_keyframe(in_map(session, {i}), point);
      point = point.after(planar_pose(1, 0, 0));
    }
  }
  return gate;
}

// What a session needs to be joined: at least six loops that agree, over 20 m, and none against them.
TEST(LoopGate, SessionsAreJoinedByManyLoopsOverALongWay) {
  const auto joined_by = [](int count, int every_m, const std::optional<LoopConstraint>& against) {
    LoopGate gate = gate_of_two_sessions();
    std::vector<LoopConstraint> loops;
    for (int i = 0; i < count; ++i) loops.push_back(loop(0, every_m * i, 0.0, 0.9999));
    for (int i = 0; i < count; ++i) loops[static_cast<std::size_t>(i)].query = in_map(1, {every_m * i});
    if (against) loops.insert(loops.begin(), *against);
    std::size_t entered = 0;
    for (const LoopConstraint& each : loops)
      for (const auto& decision : gate.offer(each)) {
        entered += decision.enters;
        if (decision.enters) gate.join(decision.loop);
      }
    for (const auto& decision : gate.decide_all()) EXPECT_FALSE(decision.enters) << "however sure, not alone";
    EXPECT_EQ(gate.part(in_map(1, {0})), entered > 0 ? 0 : 1);
    return entered;
  };
  EXPECT_EQ(joined_by(6, 5, std::nullopt), 6u) << "the sixth, with five over exactly 20 m before it";
  EXPECT_EQ(joined_by(5, 10, std::nullopt), 0u) << "five";
  EXPECT_EQ(joined_by(21, 1, std::nullopt), 0u) << "19 m before the last one";
  EXPECT_EQ(joined_by(22, 1, std::nullopt), 22u);
  LoopConstraint against = loop(0, 31, 0.0);
  against.query = in_map(1, {5});
  EXPECT_EQ(joined_by(6, 5, against), 0u) << "another loop says 26 m on";
}

// Six loops from 25 m of the way to one place say of the map what one of them says; so do loops from one place.
TEST(LoopGate, SessionsAreJoinedByLoopsThatSpreadInBoth) {
  for (const bool one_match : {false, true}) {
    LoopGate gate = gate_of_two_sessions();
    std::size_t entered = 0;
    for (int i = 0; i < 6; ++i) {
      LoopConstraint each = loop(0, one_match ? 0 : 5 * i, one_match ? 5.0 * i : -5.0 * i, 0.9999);
      each.query = in_map(1, {one_match ? 5 * i : 0});
      entered += gate.offer(each).size();
    }
    EXPECT_EQ(entered, 0u) << one_match;
  }
}

// Where one session ends the next may begin, but nobody has seen that: it takes as many loops as anywhere.
TEST(LoopGate, ASessionDoesNotGoOnWhereAnotherOneEnded) {
  LoopGate gate = gate_of_two_sessions();
  TrajectoryPoint point{.segment = 2, .origin = 2};
  for (int i = 0; i < 30; ++i) {
    gate.add_keyframe(in_map(2, {i}), point);
    point = point.after(planar_pose(1, 0, 0));
  }
  const auto offer = [&](FrameId query, FrameId match) {
    LoopConstraint each = loop(0, 0, 0.0);
    each.query = query;
    each.match = match;
    const auto decisions = gate.offer(each);
    for (const auto& decision : decisions) gate.join(decision.loop);
    return decisions.size();
  };
  std::size_t joined = 0;
  for (int i = 0; i <= 25; i += 5) joined += offer(in_map(1, {i + 30}), {i});
  ASSERT_EQ(joined, 6u);
  for (int i = 0; i <= 12; i += 3) EXPECT_EQ(offer(in_map(2, {i}), {30 + i}), 0u) << i;
}

// A corridor of another building that looks the same: what follows from one look-alike agrees with it.
TEST(LoopGate, SessionsAreJoinedInRoomsByLoopsThatAreSureOfThemselves) {
  const auto is_joined_by = [](bool in_the_open, double own_log_odds, double own_log_odds_of_last) {
    LoopGate gate = gate_of_two_sessions();
    std::size_t entered = 0;
    for (int i = 0; i < 6; ++i) {
      LoopConstraint each = loop(0, 5 * i, 0.0, 0.9999);
      each.query = in_map(1, {5 * i});
      each.in_the_open = in_the_open;
      each.own_log_odds = i < 5 ? own_log_odds : own_log_odds_of_last;
      entered += gate.offer(each).size();
    }
    return entered > 0;
  };
  EXPECT_TRUE(is_joined_by(false, 4.0, 4.0));
  EXPECT_FALSE(is_joined_by(false, 2.0, 2.0)) << "what they fit by is that they follow from each other";
  EXPECT_TRUE(is_joined_by(false, 2.0, 8.0)) << "three in the mean";
  EXPECT_FALSE(is_joined_by(false, 3.1, 2.0));
  EXPECT_TRUE(is_joined_by(true, 2.0, 2.0)) << "streets differ more";
}

TEST(LoopGate, ASessionGoesOnWhereItLostTrack) {
  const LoopGate gate = gate_that_lost_track(2.0);
  ASSERT_EQ(gate.part(in_map(1, {10})), 0);
  EXPECT_EQ(gate.part(in_map(1, {60})), 0) << "four loops over nine metres";
}

// Where no odometry leads from an earlier loop to where track was lost, or between the matches, it does not say where
// the robot was then.
TEST(LoopGate, WhereASessionGoesOnIsToldByLoopsThatOdometryLeadsTo) {
  const auto goes_on_by = [](const LoopConstraint& earlier) {
    LoopGate gate;
    TrajectoryPoint point;
    const auto add = [&](FrameId frame, bool is_lost) {
      point = is_lost ? TrajectoryPoint{.segment = point.segment + 1, .origin = point.segment + 1}
                      : point.after(planar_pose(1, 0, 0));
      gate.add_keyframe(frame, point);
    };
    for (int i = 0; i < 60; ++i) add({i}, false);
    add(in_map(1, {0}), true);
    for (int i = 1; i < 30; ++i) add(in_map(1, {i}), i == 1);  // track is lost after the first key frame
    gate.restore(earlier);
    gate.join(earlier);
    std::size_t entered = 0;
    for (int i = 1; i <= 10; i += 3) {
      LoopConstraint after = loop(0, i, 0.0);
      after.query = in_map(1, {i});
      entered += gate.offer(after).size();
    }
    return entered > 0;
  };
  LoopConstraint earlier = loop(0, 0, 0.0);
  earlier.query = in_map(1, {0});
  EXPECT_TRUE(goes_on_by(earlier)) << "the session has one key frame before";
  EXPECT_FALSE(goes_on_by(loop(30, 5, 0.0))) << "within the first session";
  earlier.match = in_map(1, {20});
  EXPECT_FALSE(goes_on_by(earlier)) << "within the second one";
}

TEST(LoopGate, LongAfterTheLastLoopFewDoNotShowThatItGoesOn) {
  const LoopGate gate = gate_that_lost_track(2.0, 70);
  ASSERT_EQ(gate.part(in_map(1, {10})), 0);
  EXPECT_NE(gate.part(in_map(1, {80})), 0) << "of queries and matches together, 98 m since: odometry may be off";
}

TEST(LoopGate, ElsewhereFewLoopsDoNotJoinWhatLostTrack) {
  for (const auto& [gap_m, joins] : {std::pair{3.5, true}, {4.5, false}, {15.0, false}}) {
    const LoopGate gate = gate_that_lost_track(gap_m);
    ASSERT_EQ(gate.part(in_map(1, {10})), 0);
    EXPECT_EQ(gate.part(in_map(1, {60})) == 0, joins) << 1.0 + gap_m << " m on, in no time";
  }
}

TEST(LoopGate, KnowsItsKeyframes) {
  LoopGate gate = gate_of_two_visits();
  EXPECT_TRUE(gate.offer(loop(1010, 10, 0.2)).empty());
  EXPECT_THROW(gate.offer(loop(5000, 10, 0.2)), std::invalid_argument);
  EXPECT_THROW(gate.offer(loop(500, 10, 0.2)), std::invalid_argument) << "between two that are there";
  EXPECT_THROW(gate.add_keyframe({3}, TrajectoryPoint{}), std::invalid_argument);
}

}  // namespace
}  // namespace revisit
