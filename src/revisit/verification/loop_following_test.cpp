// SPDX-License-Identifier: Apache-2.0
#include <revisit/verification/loop_following.hpp>

#include <gtest/gtest.h>

namespace revisit {
namespace {

constexpr double kSure = 9.0;

// A drive along x, a metre a frame, and the same one again from frame 1000 on, 0.4 m to the left.
struct TwoRounds {
  TwoRounds() {
    TrajectoryPoint then{.segment = 1},
        now{.segment = 1, .T_segment_lidar = planar_pose(500, 70, 1.2), .travelled_m = 900.0};
    for (int i = 0; i < 60; ++i) {
      places[FrameId{i}] = then;
      again.push_back(now);
      then = then.after(planar_pose(1, 0, 0));
      now = now.after(planar_pose(1, 0, 0));
    }
  }
  TrajectoryPoints places;
  std::vector<TrajectoryPoint> again;
  static constexpr FrameId kNewest{59};
};

TEST(LoopFollowing, ALoopPredictsTheNextOne) {
  const TwoRounds drive;
  LoopFollowing following;
  EXPECT_FALSE(following.predict(drive.again[10], drive.places, TwoRounds::kNewest)) << "no loop yet";
  following.add(drive.again[10], FrameId{10}, *drive.places.at(FrameId{10}), planar_pose(0, 0.4, 0), kSure);
  const auto predicted = following.predict(drive.again[17], drive.places, TwoRounds::kNewest);
  ASSERT_TRUE(predicted);
  EXPECT_EQ(predicted->match, FrameId{17});
  EXPECT_LT((predicted->T_match_query.translation() - Eigen::Vector3d(0, 0.4, 0)).norm(), 1e-9);
  EXPECT_EQ(following.predict(drive.again[17], drive.places, FrameId{14})->match, FrameId{14}) << "no newer ones";
}

TEST(LoopFollowing, SupportsThePoseThatOdometryLeadsToAndNoOther) {
  const TwoRounds drive;
  LoopFollowing following;
  following.add(drive.again[10], FrameId{10}, *drive.places.at(FrameId{10}), planar_pose(0, 0.4, 0), kSure);
  const auto support = [&](int query, int place, const Pose& T) {
    return following.support_log_odds(drive.again[static_cast<std::size_t>(query)], drive.places.at(FrameId{place}), T);
  };
  EXPECT_GT(support(12, 12, planar_pose(0, 0.4, 0)), 7.0);
  EXPECT_GT(support(12, 14, planar_pose(-2, 0.4, 0)), 7.0) << "the same from the next place but one";
  EXPECT_EQ(support(12, 12, planar_pose(1, 0.4, 0)), 0.0) << "a metre off";
  EXPECT_EQ(support(12, 12, planar_pose(0, 0.4, 0.1)), 0.0) << "6 degrees off";
  EXPECT_GT(support(12, 12, planar_pose(0, 0.4, 0)), support(25, 25, planar_pose(0, 0.4, 0)) + 0.5)
      << "the farther, the less";
  EXPECT_NEAR(support(12, 12, planar_pose(0, 0.4, 0)), 7.8, 1e-9) << "8 at most, and 0.1 less for each metre";
  EXPECT_NEAR(support(12, 12, planar_pose(0.27, 0.4, 0)), 7.8, 1e-9) << "0.2 m, and 0.08 for 2 m of query and of place";
  EXPECT_EQ(support(12, 12, planar_pose(0.29, 0.4, 0)), 0.0);
  EXPECT_EQ(support(45, 45, planar_pose(0, 0.4, 0)), 0.0) << "too far to rely on odometry";
  EXPECT_EQ(support(12, 50, planar_pose(-38, 0.4, 0)), 0.0) << "on the side of the places too";
}

TEST(LoopFollowing, CarriesLessTheFartherItIsAndNeverMoreThanTheMost) {
  EXPECT_DOUBLE_EQ(LoopFollowing::carried(3.0, 0.0), 3.0);
  EXPECT_DOUBLE_EQ(LoopFollowing::carried(3.0, 10.0), 2.0);
  EXPECT_DOUBLE_EQ(LoopFollowing::carried(20.0, 10.0), 7.0) << "8 at most";
  EXPECT_DOUBLE_EQ(LoopFollowing::carried(3.0, 40.0), 0.0) << "it never speaks against a pose";
}

TEST(LoopFollowing, SaysWhereTheQueryIsSeenFromAnyPlaceInReach) {
  const TwoRounds drive;
  LoopFollowing following;
  const auto& query = drive.again[12];
  EXPECT_FALSE(following.pose_at(query, drive.places.at(FrameId{20}))) << "no loop yet";
  following.add(drive.again[10], FrameId{10}, *drive.places.at(FrameId{10}), planar_pose(0, 0.4, 0), kSure);
  following.add(drive.again[11], FrameId{11}, *drive.places.at(FrameId{11}), planar_pose(0, 0.9, 0), 2.0);
  const auto seen = following.pose_at(query, drive.places.at(FrameId{20}));
  ASSERT_TRUE(seen);
  EXPECT_TRUE(seen->isApprox(planar_pose(-8, 0.4, 0), 1e-9)) << "by the surer loop";
  EXPECT_FALSE(following.pose_at(query, drive.places.at(FrameId{45}))) << "35 m from the places of both";
  EXPECT_FALSE(following.pose_at(std::nullopt, drive.places.at(FrameId{20})));
  EXPECT_FALSE(following.pose_at(query, std::nullopt));
}

TEST(LoopFollowing, PosesAgreeMoreLooselyTheFartherTheMotion) {
  const auto agrees = [](double off_m, double off_rad, double motion_m) {
    return agree(Pose::Identity(), planar_pose(off_m, 0, off_rad), motion_m);
  };
  EXPECT_TRUE(agrees(0.19, 0, 0));
  EXPECT_FALSE(agrees(0.21, 0, 0));
  EXPECT_TRUE(agrees(0.39, 0, 10));
  EXPECT_FALSE(agrees(0.41, 0, 10));
  EXPECT_TRUE(agrees(0, 0.019, 0));
  EXPECT_FALSE(agrees(0, 0.021, 0));
  EXPECT_TRUE(agrees(0, 0.029, 10));
  EXPECT_FALSE(agrees(0, 0.031, 10));
}

TEST(LoopFollowing, OfLoopsAsSureTheLatestPredictsAndTwentyAreRemembered) {
  const TwoRounds drive;
  LoopFollowing following;
  const auto add = [&](int i, double y_m, double log_odds) {
    const auto& query = drive.again[static_cast<std::size_t>(i)];
    following.add(query, FrameId{i}, *drive.places.at(FrameId{i}), planar_pose(0, y_m, 0), log_odds);
  };
  const auto predicted_y_m = [&] {
    return following.predict(drive.again[10], drive.places, TwoRounds::kNewest)->T_match_query.translation().y();
  };
  add(10, 0.1, kSure);
  add(10, 0.2, kSure);
  EXPECT_NEAR(predicted_y_m(), 0.2, 1e-9);
  add(10, 0.3, 5.0);
  EXPECT_NEAR(predicted_y_m(), 0.2, 1e-9) << "less sure";
  add(7, 0.4, kSure);
  EXPECT_NEAR(predicted_y_m(), 0.2, 1e-9) << "as sure, but 3 m away";
  for (int more = 0; more < 17; ++more) add(10, 0.5, 1.0);
  EXPECT_NEAR(predicted_y_m(), 0.2, 1e-9) << "the first of 21 is gone, the second is not";
  add(10, 0.5, 1.0);
  EXPECT_NEAR(predicted_y_m(), 0.4, 1e-9);
}

// A scan in an open field is not sure alone, with log odds of 1.5; each is worth what it shows and what led to it.
TEST(LoopFollowing, SupportIsPassedOnAsLongAsTheScansThemselvesAgree) {
  const TwoRounds drive;
  LoopFollowing following;
  const auto visit = [&](int i, double own_log_odds) {
    const Pose T = planar_pose(0, 0.4, 0);
    const auto& query = drive.again[static_cast<std::size_t>(i)];
    const auto& place = drive.places.at(FrameId{i});
    const double log_odds = own_log_odds + following.support_log_odds(query, place, T);
    following.add(query, FrameId{i}, *place, T, log_odds);
    return log_odds;
  };
  EXPECT_DOUBLE_EQ(visit(0, kSure), kSure);
  for (int i = 1; i < 59; ++i) EXPECT_GT(visit(i, 1.5), 8.0) << i << " m on, twice as far as one loop reaches";
}

TEST(LoopFollowing, OtherSegmentsAndScansWithoutOdometryHaveNoPrior) {
  const TwoRounds drive;
  LoopFollowing following;
  const TrajectoryPoint elsewhere{.segment = 2};
  following.add(drive.again[10], FrameId{10}, *drive.places.at(FrameId{10}), Pose::Identity(), kSure);
  EXPECT_FALSE(following.predict(elsewhere, drive.places, TwoRounds::kNewest));
  EXPECT_FALSE(following.predict(std::nullopt, drive.places, TwoRounds::kNewest));
  EXPECT_EQ(following.support_log_odds(elsewhere, drive.places.at(FrameId{10}), Pose::Identity()), 0.0);
  EXPECT_EQ(following.support_log_odds(drive.again[10], std::nullopt, Pose::Identity()), 0.0);
  EXPECT_EQ(following.support_log_odds(drive.again[10], elsewhere, Pose::Identity()), 0.0);
}

TEST(ReliableMotion, TurnsCountAsTheMetresThatBringAsMuchError) {
  TrajectoryPoint point{.segment = 1};
  for (int i = 0; i < 10; ++i) point = point.after(planar_pose(0, 0, 0.5));
  EXPECT_NEAR(point.turned_rad, 5.0, 1e-9) << "a robot that spins on the spot";
  EXPECT_NEAR(point.travelled_m, 0.0, 1e-9);
  EXPECT_GT(reliable_motion_m(TrajectoryPoint{.segment = 1}, point).value(), 20.0);
  for (int i = 0; i < 10; ++i) point = point.after(planar_pose(0, 0, 0.5));
  EXPECT_FALSE(reliable_motion_m(TrajectoryPoint{.segment = 1}, point));
}

TEST(NearestPlace, IsTheOneWithTheShortestTranslationAmongConnectedOnes) {
  TwoRounds drive;
  const auto nearest = nearest_place(drive.places, FrameId{10}, planar_pose(3.2, 0.4, 0), TwoRounds::kNewest);
  ASSERT_TRUE(nearest);
  EXPECT_EQ(nearest->match, FrameId{13});
  EXPECT_NEAR(nearest->T_match_query.translation().x(), 0.2, 1e-9);
  drive.places.at(FrameId{12}).reset();
  EXPECT_EQ(nearest_place(drive.places, FrameId{10}, planar_pose(3.2, 0.4, 0), TwoRounds::kNewest)->match, FrameId{11})
      << "odometry failed at 12: what lies behind is not connected";
  EXPECT_EQ(nearest_place(drive.places, FrameId{10}, planar_pose(-10.2, 0.4, 0), TwoRounds::kNewest)->match, FrameId{0})
      << "the first place counts, too";
  EXPECT_EQ(nearest_place(drive.places, FrameId{59}, planar_pose(-50, 0, 0), TwoRounds::kNewest)->match, FrameId{29})
      << "no farther than odometry is relied on";
  EXPECT_FALSE(nearest_place(drive.places, FrameId{12}, Pose::Identity(), TwoRounds::kNewest)) << "not on the drive";
  EXPECT_FALSE(nearest_place(drive.places, FrameId{200}, Pose::Identity(), TwoRounds::kNewest)) << "not known";
}

}  // namespace
}  // namespace revisit
