// SPDX-License-Identifier: Apache-2.0
#include <revisit/localisation/pose_belief.hpp>

#include <array>

#include <gtest/gtest.h>

namespace revisit {
namespace {

// A robot that drives along x; its odometry began at `start` of the map.
struct Drive {
  TrajectoryPoint point{.T_segment_lidar = Pose::Identity()};
  Pose T_map_start = planar_pose(100, 50, 1.0);
  PoseBelief belief;

  PoseBelief::Sighting seen(double log_odds, const Pose& T_off = Pose::Identity(), std::int64_t match = 1) const {
    return {{match}, 0, T_off * T_map_start * point.T_segment_lidar, log_odds};
  }
  void go(double metres) { point = point.after(planar_pose(metres, 0, 0)); }
};

TEST(PoseBelief, ViewsThatAreUnsureAddUp) {
  Drive drive;
  double before = -1.0;
  for (int i = 0; i < 4; ++i) {
    const auto sighting = drive.seen(1.2, Pose::Identity(), i);
    drive.belief.add(drive.point, std::span(&sighting, 1));
    const auto best = drive.belief.best();
    ASSERT_TRUE(best);
    EXPECT_GT(best->log_odds, before);
    EXPECT_TRUE(best->T_map_segment.isApprox(drive.T_map_start, 1e-9));
    EXPECT_EQ(best->match, FrameId{i});
    before = best->log_odds;
    drive.go(3.0);
  }
  EXPECT_GT(before, 4.0);
}

TEST(PoseBelief, TheSameViewCountsOnce) {
  Drive drive;
  for (int i = 0; i < 50; ++i) {
    const auto sighting = drive.seen(1.0);
    drive.belief.add(drive.point, std::span(&sighting, 1));
  }
  EXPECT_LT(drive.belief.best()->log_odds, 1.1);
}

// What resembles others must show more, and goes on to do so where a scan saw something else.
TEST(PoseBelief, RemembersWhetherItResemblesOthers) {
  Drive drive;
  auto sighting = drive.seen(4.0);
  EXPECT_FALSE(sighting.resembles_others);
  sighting.resembles_others = true;
  drive.belief.add(drive.point, std::span(&sighting, 1));
  EXPECT_TRUE(drive.belief.best()->resembles_others);
  drive.go(0.3);
  const auto other = drive.seen(1.0, planar_pose(40, 0, 0), 2);
  drive.belief.add(drive.point, std::span(&other, 1));
  EXPECT_EQ(drive.belief.best()->match, FrameId{1});
  EXPECT_TRUE(drive.belief.best()->resembles_others);
  drive.go(0.3);
  const auto again = drive.seen(1.0);
  drive.belief.add(drive.point, std::span(&again, 1));
  EXPECT_FALSE(drive.belief.best()->resembles_others) << "it went out of the door";
}

// Two places look alike; further on only one of them fits.
TEST(PoseBelief, OfTwoPlacesTheWayDecides) {
  Drive drive;
  const Pose T_other = planar_pose(40, 0, 0);
  for (int i = 0; i < 3; ++i) {
    const std::array both{drive.seen(4.0), drive.seen(4.0, T_other)};
    drive.belief.add(drive.point, i < 2 ? std::span(both) : std::span(both).first(1));
    if (i < 2) {
      EXPECT_LT(drive.belief.best()->log_odds, 0.1) << "either may be right";
    }
    drive.go(3.0);
  }
  const auto best = drive.belief.best();
  EXPECT_GT(best->log_odds, 3.0);
  EXPECT_TRUE(best->T_map_segment.isApprox(drive.T_map_start, 1e-9));
}

TEST(PoseBelief, WhatNeverFitsWellNeverBecomesSure) {
  Drive drive;
  for (int i = 0; i < 30; ++i) {
    const auto sighting = drive.seen(-3.0);
    drive.belief.add(drive.point, std::span(&sighting, 1));
    drive.go(3.0);
    const auto best = drive.belief.best();
    EXPECT_TRUE(!best || best->log_odds < 0.0);
  }
}

// Somebody said that it is there; what is seen on the way speaks against it.
TEST(PoseBelief, APriorCountsOnce) {
  Drive drive;
  for (int i = 0; i < 8; ++i) {
    auto sighting = drive.seen(-2.0);
    sighting.prior_log_odds = 4.7;
    drive.belief.add(drive.point, std::span(&sighting, 1));
    drive.go(3.0);
  }
  const auto best = drive.belief.best();
  EXPECT_TRUE(!best || best->log_odds < 0.0) << best->log_odds;
}

TEST(PoseBelief, AnotherSegmentBeginsAnew) {
  Drive drive;
  const auto sighting = drive.seen(5.0);
  drive.belief.add(drive.point, std::span(&sighting, 1));
  drive.point.segment = 1;
  drive.belief.add(drive.point, {});
  EXPECT_FALSE(drive.belief.best());
}

TEST(PoseBelief, AViewThatDoesNotDecideAloneCountsLittle) {
  for (const bool alike : {true, false}) EXPECT_EQ(PoseBelief::log_odds_of_view(7.0, true, alike), 7.0);
  EXPECT_EQ(PoseBelief::log_odds_of_view(5.0, false, false), 2.0);
  EXPECT_EQ(PoseBelief::log_odds_of_view(1.5, false, false), 1.5);
  EXPECT_EQ(PoseBelief::log_odds_of_view(5.0, false, true), 1.0);
  EXPECT_EQ(PoseBelief::log_odds_of_view(1.5, false, true), 0.5) << "rooms are alike";
  EXPECT_EQ(PoseBelief::log_odds_of_view(-3.0, false, true), -4.0);
}

}  // namespace
}  // namespace revisit
