// SPDX-License-Identifier: Apache-2.0
#include <revisit/verification/candidate_registration.hpp>

#include <cmath>
#include <utility>

#include <gtest/gtest.h>

#include <revisit/verification/look_alikes.hpp>

#include "remembered_places.hpp"

namespace revisit {
namespace {

using testing_support::described;
using testing_support::Described;
using testing_support::SyntheticWorld;

// A scan beside place 2, a third of a turn to the left.
class CandidateRegistrationTest : public testing_support::RememberedPlaces {
 protected:
  std::vector<Hypothesis> tested(const std::vector<int>& frames, const std::optional<TrajectoryPoint>& point = {}) {
    const VerificationContext known = context();
    const VerificationQuery question{FrameId{1000}, query_.descriptor, query_.cloud, nullptr, point};
    return *CandidateRegistration(known, question).test(candidates(query_, frames));
  }
  Pose truth(int frame) const { return SyntheticWorld::at(frame, 0, 0).inverse() * T_world_query_; }

  const Pose T_world_query_ = SyntheticWorld::at(2.3, 0.4, 2.1);
  const Described query_ = described(home_, T_world_query_);
};

TEST_F(CandidateRegistrationTest, TheBestFromOverheadAreRegisteredAndNoMore) {
  for (const int most : {1, 3, 4}) {
    parameters_.geometric.candidates = most;
    const auto found = tested({0, 2, 4});
    ASSERT_EQ(found.size(), static_cast<std::size_t>(most));
    for (std::size_t i = 1; i < found.size(); ++i) EXPECT_GE(found[i - 1].overlap, found[i].overlap);
  }
  EXPECT_EQ(tested({2}).size(), CandidateRegistration::kPosesAPlace) << "two poses a place";
}

TEST_F(CandidateRegistrationTest, AScanAloneMayOverlapLess) {
  const double overlap = tested({2}).front().overlap;
  const TrajectoryPoint on_its_way{.segment = 7};
  for (const auto& [share, alone] : {std::pair{0.7, true}, {0.6, false}}) {
    parameters_.geometric.min_overlap = overlap / share;
    EXPECT_EQ(tested({2}).front().geometric.has_value(), alone) << share;
    EXPECT_FALSE(tested({2}, on_its_way).front().geometric) << "its neighbours may overlap more";
  }
}

TEST_F(CandidateRegistrationTest, OfARegisteredOneThePoseIsRight) {
  const Hypothesis best = tested({2, 3}).front();
  ASSERT_TRUE(best.geometric);
  EXPECT_FALSE(best.refusal);
  const Pose error = truth(static_cast<int>(best.candidate.match.value)).inverse() * best.geometric->T_match_query;
  EXPECT_LT(error.translation().norm(), 0.1);
  EXPECT_LT(rotation_angle(error), to_radians(0.3));
}

TEST_F(CandidateRegistrationTest, WithoutTheOverheadSearchTheHeadingOfTheDescriptorsIsTheStart) {
  parameters_.geometric.overhead_search = false;
  parameters_.geometric.candidates = 2;
  const auto found = tested({2, 3, 4});
  ASSERT_EQ(found.size(), 2u) << "as retrieval ordered them";
  EXPECT_EQ(found[0].candidate.match, FrameId{2});
  EXPECT_EQ(found[0].overlap, 0.0) << "not measured, and no objection";
  EXPECT_NEAR(found[0].T_guess_match_query.translation().norm(), 0.0, 1e-6);
  EXPECT_NEAR(yaw_of(found[0].T_guess_match_query), found[0].candidate.yaw_rad, 1e-6);
  EXPECT_TRUE(found[0].is_accepted());
}

TEST_F(CandidateRegistrationTest, WhatOdometryKnowsToBeElsewhereIsNotRegistered) {
  const TrajectoryPoint far = points_.at(FrameId{5})->after(planar_pose(300.0, 0, 0));
  const auto found = tested({2, 3}, far);
  ASSERT_EQ(found.size(), 1u) << "the first of them says why";
  EXPECT_EQ(found[0].candidate.match, FrameId{2});
  ASSERT_TRUE(found[0].refusal);
  EXPECT_EQ(found[0].refusal->reason, Refusal::Reason::kElsewhere);
  EXPECT_FALSE(found[0].geometric);
  const auto another = tested({2, 90}, far);
  for (const Hypothesis& each : another) EXPECT_EQ(each.candidate.match, FrameId{90}) << "of 90 it knows nothing";
  parameters_.geometric.follow = false;
  EXPECT_TRUE(tested({2, 3}, far).front().is_accepted()) << "without odometry";
}

TEST_F(CandidateRegistrationTest, WhereTrackWasLostInOneDriveOdometryNotKnowingSpeaksAgainstAPose) {
  const auto log_odds = [&](bool is_one_drive, const std::optional<TrajectoryPoint>& point, FrameId frame,
                            const Described& query, int place = 2) {
    VerificationContext known = context();
    known.is_one_drive = is_one_drive;
    const VerificationQuery question{frame, query.descriptor, query.cloud, nullptr, point};
    return CandidateRegistration(known, question).test(candidates(query, {place}))->front().geometric->log_odds;
  };
  const TrajectoryPoint lost{.segment = 9, .origin = 9};
  const double usual = log_odds(false, lost, FrameId{1000}, query_);
  EXPECT_NEAR(log_odds(true, lost, FrameId{1000}, query_), usual - 3.0, 1e-9);
  EXPECT_NEAR(log_odds(true, std::nullopt, FrameId{1000}, query_), usual, 1e-9) << "a scan alone was never tracked";
  EXPECT_NEAR(log_odds(true, lost, FrameId{(std::int64_t{1} << 40) + 5}, query_), usual, 1e-9) << "another session";
  add(7, described(home_, SyntheticWorld::at(2.0, 0.0, 0.0), 120.0), points_.at(FrameId{2}));
  const Described narrow = described(home_, SyntheticWorld::at(2.3, 0.4, 0.1), 120.0);
  EXPECT_NEAR(log_odds(true, lost, FrameId{1000}, narrow, 7), log_odds(false, lost, FrameId{1000}, narrow, 7) - 6.0,
              1e-9)
      << "of a street a narrow sensor sees too little";
}

TEST_F(CandidateRegistrationTest, OfAPredictedPlaceOnlyThePoseIsOpen) {
  const VerificationContext known = context();
  const VerificationQuery question{FrameId{1000}, query_.descriptor, query_.cloud, nullptr, std::nullopt};
  const auto log_odds = [&](const Pose& T_predicted, double sure) {
    const auto found = CandidateRegistration(known, question).test(PosePrediction{FrameId{2}, T_predicted, sure});
    EXPECT_LT((truth(2).inverse() * found->geometric->T_match_query).translation().norm(), 0.1);
    return found->geometric->log_odds;
  };
  const double alone = log_odds(truth(2), 0.0);
  EXPECT_NEAR(log_odds(truth(2), 5.0), alone + 5.0, 1e-9) << "it was sure of that pose";
  EXPECT_NEAR(log_odds(truth(2) * planar_pose(0.6, 0, 0), 5.0), alone, 1e-6) << "0.6 m off: of another one";
  EXPECT_FALSE(CandidateRegistration(known, question).test(PosePrediction{FrameId{55}, truth(2), 0.0}));
}

// A hall with a pillar every 3 m and a wall at its end: 3.2 m on, a registration that begins at the same spot ends
// beside the pillars next to the right ones.
TEST_F(CandidateRegistrationTest, WhereALoopBeforeHasAnotherPoseTheScansDecide) {
  const auto hall = [](double x_m) {
    std::vector<Point> points;
    const auto add = [&](double x, double y, double z) {
      points.push_back({static_cast<float>(x - x_m), static_cast<float>(y), static_cast<float>(z), 0.5f});
    };
    for (double z = -1.0; z <= 2.0; z += 0.2) {
      for (double x = -15.0; x <= 15.0; x += 0.2)
        for (const double side : {-1.0, 1.0}) add(x, side * (std::fmod(x + 15.0, 3.0) < 0.6 ? 4.0 : 5.0), z);
      for (double y = -4.0; y <= 4.0; y += 0.2) add(15.0, y, z), add(-15.0, y, z);
    }
    return Described{describe(points, {}), thin_for_registration(points, {})};
  };
  add(70, hall(0.0), points_.at(FrameId{0}));
  const Described query = hall(3.2);
  const TrajectoryPoint now{.segment = 7};
  parameters_.geometric.overhead_search = false;
  parameters_.geometric.min_probability = 0.0;
  const auto found_x_m = [&](std::optional<double> by_loop_m) {
    following_ = {};
    if (by_loop_m) following_.add(now, FrameId{70}, *points_.at(FrameId{70}), planar_pose(*by_loop_m, 0, 0), 12.0);
    const VerificationContext known = context();
    const VerificationQuery question{FrameId{1000}, query.descriptor, query.cloud, nullptr, now};
    LoopCandidate candidate;
    candidate.match = FrameId{70};
    const auto found = CandidateRegistration(known, question).test({&candidate, 1});
    EXPECT_TRUE(found->front().is_accepted());
    return found->front().geometric->T_match_query.translation().x();
  };
  EXPECT_NEAR(found_x_m(std::nullopt), 0.2, 0.3) << "a pillar off";
  EXPECT_NEAR(found_x_m(3.0), 3.2, 0.05);
  EXPECT_NEAR(found_x_m(-2.6), 0.2, 0.3) << "that loop is wrong, and fits worse still";
  parameters_.geometric.follow = false;
  EXPECT_NEAR(found_x_m(3.0), 0.2, 0.3) << "loops are not to count";
}

TEST_F(CandidateRegistrationTest, APlaceElsewhereIsScoredUnlessItIsThePlace) {
  const VerificationContext known = context();
  const VerificationQuery question{FrameId{1000}, query_.descriptor, query_.cloud, nullptr, std::nullopt};
  CandidateRegistration registration(known, question);
  EXPECT_FALSE(registration.log_odds_elsewhere(FrameId{2}, truth(2))->has_value()) << "it is right after all";
  const auto right = registration.log_odds_elsewhere(FrameId{2}, truth(2) * planar_pose(20, 0, 0));
  const auto wrong = registration.log_odds_elsewhere(FrameId{90}, planar_pose(40, 0, 0));
  ASSERT_TRUE(right && *right && wrong && *wrong);
  EXPECT_LT(**wrong, **right - 5.0);
  EXPECT_FALSE(registration.log_odds_elsewhere(FrameId{55}, truth(2))) << "it cannot be read";
  parameters_.geometric.min_overlap = 1.1;
  EXPECT_EQ(*registration.log_odds_elsewhere(FrameId{90}, planar_pose(40, 0, 0)), LookAlikes::kNotRegistered);
}

TEST_F(CandidateRegistrationTest, APlaceThatLooksTheSameTurnedIsRefusedForItsHeading) {
  const TrajectoryPoint turned = points_.at(FrameId{2})->after(planar_pose(0.3, 0.4, 2.1 + 1.5));
  const Hypothesis found = tested({2}, turned).front();
  ASSERT_TRUE(found.geometric && found.refusal);
  EXPECT_EQ(found.refusal->reason, Refusal::Reason::kOtherHeading) << "86 degrees off in a metre";
}

// Two scans of 60 degrees from one place, taken by a sensor that had looked round before.
class WiderViewTest : public CandidateRegistrationTest {
 protected:
  Described narrow(const Pose& T_world_lidar, bool is_widened, const Pose& T_error = Pose::Identity()) const {
    Described scan = described(home_, T_world_lidar, 60.0);
    if (!is_widened) return scan;
    ThinCloud before = described(home_, T_world_lidar * T_error, 220.0).cloud;
    scan.cloud.before = std::make_shared<const ThinCloud>(std::move(before));
    return scan;
  }
  Hypothesis found(const Described& query, const Described& place) {
    add(70, place, std::nullopt);
    geometries_ = {};
    parameters_.geometric.overhead_search = false;  // it would find little in common
    const VerificationContext known = context();
    const VerificationQuery question{FrameId{1000}, query.descriptor, query.cloud, nullptr, std::nullopt};
    return CandidateRegistration(known, question).test(candidates(query, {70}))->front();
  }
  Pose T_place_narrow() const { return T_world_place_.inverse() * T_world_narrow_; }
  const Pose T_world_place_ = SyntheticWorld::at(2, 0, 0), T_world_narrow_ = SyntheticWorld::at(2.4, 0.3, 0.1);
};

TEST_F(WiderViewTest, WhatWasSeenBeforeDecidesWhereTwoScansDoNot) {
  const Described query = narrow(T_world_narrow_, true), place = narrow(T_world_place_, true);
  parameters_.geometric.min_probability = 0.0;
  const double alone = found(narrow(T_world_narrow_, false), narrow(T_world_place_, false)).geometric->log_odds;
  const Described all_round = {query.descriptor, with_before(query.cloud)};
  const double together = found(all_round, {place.descriptor, with_before(place.cloud)}).geometric->log_odds;
  ASSERT_GT(together, alone + 1.0);
  parameters_.geometric.min_probability = probability_of((alone + together) / 2.0);
  EXPECT_FALSE(found(narrow(T_world_narrow_, false), narrow(T_world_place_, false)).is_accepted());
  const Hypothesis wider = found(query, place);
  ASSERT_TRUE(wider.is_accepted());
  EXPECT_LT((wider.geometric->T_match_query.translation() - T_place_narrow().translation()).norm(), 0.1);
}

TEST_F(WiderViewTest, ButNotWhereItHasAnotherPose) {
  parameters_.geometric.min_probability = 0.0;
  const double alone = found(narrow(T_world_narrow_, false), narrow(T_world_place_, false)).geometric->log_odds;
  parameters_.geometric.min_probability = probability_of(alone + 0.1);
  EXPECT_TRUE(found(narrow(T_world_narrow_, true), narrow(T_world_place_, true)).is_accepted());
  const Described crooked = narrow(T_world_place_, true, planar_pose(0.8, 0.0, 0.0));
  EXPECT_FALSE(found(narrow(T_world_narrow_, true), crooked).is_accepted());
}

// What was dark is bright, as in a place that has the same walls.
TEST_F(WiderViewTest, NorWhereTheScansThemselvesSpeakAgainstIt) {
  Described repainted = narrow(T_world_narrow_, true);
  for (float& each : repainted.cloud.intensity) each = 1.f - each;
  const Described place = narrow(T_world_place_, true);
  const auto together = [&] {
    return check_widened(ScanGeometry(place.cloud), ScanGeometry(repainted.cloud), {T_place_narrow()},
                         parameters_.geometric);
  };
  parameters_.geometric.min_probability = probability_of(together().own_log_odds - 0.1);
  ASSERT_TRUE(together().is_consistent()) << "what was seen before would do";
  EXPECT_FALSE(found(repainted, place).is_accepted());
}

}  // namespace
}  // namespace revisit
