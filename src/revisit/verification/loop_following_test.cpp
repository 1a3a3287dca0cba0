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
  EXPECT_EQ(support(45, 45, planar_pose(0, 0.4, 0)), 0.0) << "too far to rely on odometry";
  EXPECT_EQ(support(12, 50, planar_pose(-38, 0.4, 0)), 0.0) << "on the side of the places too";
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
}

}  // namespace
}  // namespace revisit
