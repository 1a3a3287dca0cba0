// SPDX-License-Identifier: Apache-2.0
#include <revisit/verification/elsewhere.hpp>

#include <cmath>

#include <gtest/gtest.h>

namespace revisit {
namespace {

const TrajectoryPoint lost{.segment = 9, .origin = 9};
LoopEvidence with(bool LoopEvidence::*what, bool is_so) {
  LoopEvidence evidence;
  evidence.*what = is_so;
  return evidence;
}

const LoopEvidence around, narrow = with(&LoopEvidence::both_are_narrow, true);

TEST(Elsewhere, IsWhatOdometryCannotBeWrongAbout) {
  const TrajectoryPoint place{.segment = 1, .origin = 1};
  TrajectoryPoint query = place;
  for (int metre = 0; metre < 100; ++metre) query = query.after(planar_pose(1.0, 0.0, 0.0));
  const auto refusal = refuse_elsewhere(place, query);  // 100 m away after 100 m
  ASSERT_TRUE(refusal);
  EXPECT_EQ(refusal->reason, Refusal::Reason::kElsewhere);
  EXPECT_DOUBLE_EQ(refusal->value, 100.0);
  EXPECT_DOUBLE_EQ(refusal->limit, 21.0);

  TrajectoryPoint back = query;
  back.T_segment_lidar = planar_pose(20.0, 0.0, 0.0);
  EXPECT_FALSE(refuse_elsewhere(place, back)) << "20 m away after 100 m: that may be drift";
  back.T_segment_lidar = planar_pose(40.0, 0.0, 0.0);
  EXPECT_TRUE(refuse_elsewhere(place, back));
  back.turned_rad = 200.0;
  EXPECT_FALSE(refuse_elsewhere(place, back)) << "turns bring drift as well";
}

TEST(Elsewhere, IsWhatLooksTheSameTurned) {
  const TrajectoryPoint place{.segment = 1};
  const TrajectoryPoint query = place.after(planar_pose(10.0, 0.0, to_radians(30.0)));
  EXPECT_FALSE(refuse_heading(place, query, planar_pose(8.0, 0.0, to_radians(60.0))));
  const auto refusal = refuse_heading(place, query, planar_pose(8.0, 0.0, to_radians(120.0)));
  ASSERT_TRUE(refusal);
  EXPECT_EQ(refusal->reason, Refusal::Reason::kOtherHeading);
  EXPECT_NEAR(refusal->value, 90.0, 1e-9);
  EXPECT_NEAR(refusal->limit, 40.0 + 0.02 * (10.0 + 2.0 * to_radians(30.0)), 1e-9) << "a turn counts as metres";
  EXPECT_FALSE(refuse_heading(std::nullopt, query, planar_pose(8.0, 0.0, to_radians(120.0))));
  EXPECT_FALSE(refuse_heading(place, std::nullopt, planar_pose(8.0, 0.0, to_radians(120.0))));
  EXPECT_FALSE(refuse_heading(place, lost, planar_pose(8.0, 0.0, to_radians(120.0))));
}

TEST(Elsewhere, IsTheLessLikelyTheFartherOdometryIs) {
  const TrajectoryPoint place{.segment = 1, .origin = 1};
  const TrajectoryPoint query = place.after(planar_pose(500.0, 0.0, 0.0));  // a deviation of 3 m
  EXPECT_DOUBLE_EQ(odometry_log_odds(place, query, planar_pose(500.0, 0.0, 0.0), around), 0.0);
  EXPECT_NEAR(odometry_log_odds(place, query, planar_pose(497.0, 0.0, 0.0), around), -0.5, 1e-9);
  EXPECT_NEAR(odometry_log_odds(place, query, planar_pose(494.0, 0.0, 0.0), around), -2.0, 1e-9);
  EXPECT_DOUBLE_EQ(odometry_log_odds(place, query, planar_pose(490.5, 0.0, 0.0), around), -10.0)
      << "more than three of them";
  EXPECT_NEAR(odometry_log_odds(place, query, planar_pose(495.5, 0.0, 0.0), narrow), -0.5, 1e-9)
      << "of a sector: 4.5 m";
  EXPECT_DOUBLE_EQ(odometry_log_odds(place, lost, planar_pose(0.0, 0.0, 0.0), around), 0.0);
  EXPECT_DOUBLE_EQ(odometry_log_odds(place, lost, planar_pose(0.0, 0.0, 0.0), around, -3.0), -3.0);
  EXPECT_DOUBLE_EQ(odometry_log_odds(place, query, planar_pose(500.0, 0.0, 0.0), around, -3.0), 0.0);
  EXPECT_DOUBLE_EQ(odometry_log_odds(place, std::nullopt, planar_pose(0.0, 0.0, 0.0), around, -3.0), -3.0)
      << "a scan alone";
}

TEST(Elsewhere, IsConceivableInTheOpenWhereOdometryMadeAMistake) {
  const TrajectoryPoint place{.segment = 1, .origin = 1};
  const TrajectoryPoint query = place.after(planar_pose(500.0, 0.0, 0.0));
  const Pose off = planar_pose(484.6, 0.0, 0.0), far_off = planar_pose(484.4, 0.0, 0.0);
  EXPECT_DOUBLE_EQ(odometry_log_odds(place, query, off, around), -10.0) << "3 % of 500 m, and 0.5 m";
  EXPECT_DOUBLE_EQ(odometry_log_odds(place, query, far_off, around), -20.0);
  EXPECT_DOUBLE_EQ(odometry_log_odds(place, query, off, with(&LoopEvidence::in_the_open, false)), -20.0)
      << "rooms resemble one another";
  EXPECT_DOUBLE_EQ(odometry_log_odds(place, query, off, with(&LoopEvidence::one_in_a_room, true)), -20.0);
  const TrajectoryPoint soon = place.after(planar_pose(20.0, 0.0, 0.0));
  EXPECT_DOUBLE_EQ(odometry_log_odds(place, soon, planar_pose(17.0, 0.0, 0.0), around), -20.0)
      << "3 m after 20 m: the next house";
}

TEST(Elsewhere, WhatGapsAreOffAddsUpAsTheirVariances) {
  const TrajectoryPoint place{.segment = 1, .origin = 1};
  TrajectoryPoint query = place;
  for (int gap = 0; gap < 9; ++gap) query = query.after_gap(Pose::Identity(), 0.5);
  EXPECT_NEAR(odometry_log_odds(place, query, planar_pose(std::sqrt(2.5), 0.0, 0.0), around), -0.5, 1e-9)
      << "0.5 m, and 1.5 m of nine gaps";
}

TEST(Elsewhere, IsNotKnownWithoutOdometry) {
  const TrajectoryPoint place{.segment = 1, .origin = 1};
  TrajectoryPoint query = place.after(planar_pose(1000.0, 0.0, 0.0));
  EXPECT_TRUE(refuse_elsewhere(place, query));
  EXPECT_FALSE(refuse_elsewhere(std::nullopt, query));
  EXPECT_FALSE(refuse_elsewhere(place, std::nullopt));
  EXPECT_TRUE(refuse_elsewhere(place, place.after_gap(planar_pose(1000.0, 0.0, 0.0), 2.0)));
  EXPECT_FALSE(refuse_elsewhere(place, place.after_gap(planar_pose(1000.0, 0.0, 0.0), 1000.0)));
  EXPECT_FALSE(refuse_elsewhere(place, lost)) << "tracking was lost in between";
}

TEST(Elsewhere, TwoPosesOfOneQueryAreOthersBeyondWhatOdometryMayBeOff) {
  const TrajectoryPoint a{.segment = 1, .origin = 1}, b = a.after(planar_pose(10.0, 0.0, 0.0));
  const auto are_other = [&](double b_to_query_m) {  // from a the query is seen 12 m ahead
    return are_other_poses(a, planar_pose(12.0, 0.0, 0.0), b, planar_pose(b_to_query_m, 0.0, 0.0));
  };
  EXPECT_FALSE(are_other(2.0)) << "the same pose, seen from both";
  EXPECT_FALSE(are_other(3.5)) << "1 m, and 6 in a hundred of the 10 m in between";
  EXPECT_TRUE(are_other(3.7));
  EXPECT_FALSE(are_other(0.5));
  EXPECT_FALSE(are_other_poses(a, Pose::Identity(), lost, planar_pose(50.0, 0.0, 0.0))) << "nobody knows";
}

TEST(PlacesElsewhere, AreAtMostSixtyTheLatestFirst) {
  TrajectoryPoints places;
  TrajectoryPoint point{.segment = 3};
  for (int frame = 0; frame < 200; ++frame) {
    places[FrameId{frame}] = point;
    point = point.after(planar_pose(1.0, 0.0, 0.0));
  }
  const auto known = places_elsewhere(places, point);
  ASSERT_EQ(known.size(), 60u);
  EXPECT_EQ(known.front().value, 184);
  EXPECT_EQ(known.back().value, 125);
}

TEST(PlacesElsewhere, AreThoseThatOdometryKnowsToBe) {
  TrajectoryPoints places;
  TrajectoryPoint point{.segment = 3};
  for (int frame = 0; frame < 40; ++frame) {  // a metre a frame
    places[FrameId{frame}] = point;
    point = point.after(planar_pose(1.0, 0.0, 0.0));
  }
  places[FrameId{5}].reset();
  EXPECT_EQ(places_elsewhere(places, point).back().value, 6) << "beyond a place without a point, nothing is known";
  places.erase(FrameId{5});
  const auto known = places_elsewhere(places, point);
  ASSERT_FALSE(known.empty());
  EXPECT_EQ(known.front().value, 24) << "16 m before: 15 m and 3 in a hundred of the way";
  EXPECT_EQ(known.back().value, 0);
  EXPECT_TRUE(places_elsewhere(places, lost).empty());
}

}  // namespace
}  // namespace revisit
