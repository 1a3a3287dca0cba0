// SPDX-License-Identifier: Apache-2.0
#include <revisit/verification/loop_probability.hpp>

#include <cmath>

#include <gtest/gtest.h>

namespace revisit {
namespace {

LoopEvidence usual_revisit() {
  return {.inlier_ratio = 0.8,
          .inlier_share = 0.95,
          .free_space_agreement = 0.985,
          .intensity_agreement = 0.95,
          .rmse_m = 0.12,
          .overlap = 0.8,
          .least_fixed = 0.25,
          .inliers = 1500,
          .distance_m = 1.0};
}

TEST(LoopProbability, AUsualRevisitIsSureAndALookAlikeIsNot) {
  EXPECT_GT(probability_of(loop_log_odds(usual_revisit())), 0.98);
  LoopEvidence look_alike = usual_revisit();
  look_alike.inlier_share = 0.5;
  look_alike.free_space_agreement = 0.8;
  look_alike.intensity_agreement = 0.75;
  look_alike.rmse_m = 0.2;
  look_alike.least_fixed = 0.02;
  EXPECT_LT(probability_of(loop_log_odds(look_alike)), 0.9);
}

TEST(LoopProbability, EachPieceOfEvidenceCounts) {
  const double before = loop_log_odds(usual_revisit());
  const auto after = [](auto change) {
    LoopEvidence evidence = usual_revisit();
    change(evidence);
    return loop_log_odds(evidence);
  };
  EXPECT_LT(after([](LoopEvidence& e) { e.inlier_share -= 0.1; }), before);
  EXPECT_LT(after([](LoopEvidence& e) { e.one_is_narrow = true; }), before);
  EXPECT_LT(after([](LoopEvidence& e) { e.both_are_narrow = true; }), before) << "other streets fit, too";
  EXPECT_LT(after([](LoopEvidence& e) { e.free_space_agreement -= 0.02; }), before);
  EXPECT_LT(after([](LoopEvidence& e) { *e.intensity_agreement -= 0.1; }), before);
  EXPECT_LT(after([](LoopEvidence& e) { e.rmse_m += 0.02; }), before);
  EXPECT_LT(after([](LoopEvidence& e) { e.voxel_m = 0.5; }), before) << "the same residual in a finer world";
  EXPECT_LT(after([](LoopEvidence& e) { e.least_fixed = 0.01; }), before - 1.0) << "it may slide along a wall";
  EXPECT_LT(after([](LoopEvidence& e) { e.inliers = 100; }), before - 1.0) << "few points may fit by chance";
  EXPECT_GT(after([](LoopEvidence& e) { e.distance_m += 4.0; }), before) << "from afar less must fit";
}

// Worked out apart from the program, from the coefficients that were learnt.
TEST(LoopProbability, IsTheModelThatWasLearnt) {
  LoopEvidence evidence{.inlier_share = 0.6,
                        .hidden_share = 0.25,
                        .free_space_agreement = 0.95,
                        .intensity_agreement = 0.8,
                        .rmse_m = 0.12,
                        .residual_share = 1.4,
                        .voxel_m = 0.8,
                        .least_fixed = 0.04,
                        .inliers = 150,
                        .distance_m = 5.0};
  LoopEvidence in_room = evidence;
  in_room.in_the_open = false;
  EXPECT_NEAR(loop_log_odds(evidence), -3.373592623, 1e-8);
  EXPECT_NEAR(loop_log_odds(in_room), -6.770246355, 1e-8);
  LoopEvidence far = evidence;
  far.distance_m = 20.0;
  evidence.distance_m = 12.0;
  EXPECT_DOUBLE_EQ(loop_log_odds(far), loop_log_odds(evidence)) << "nothing was learnt beyond 12 m";
  evidence.distance_m = 5.0;
  for (LoopEvidence* each : {&evidence, &in_room}) each->intensity_agreement.reset();
  EXPECT_NEAR(loop_log_odds(evidence), -3.045077178, 1e-8);
  EXPECT_NEAR(loop_log_odds(in_room), -8.137493519, 1e-8);
  in_room.both_are_narrow = true;
  EXPECT_NEAR(loop_log_odds(in_room), -8.137493519, 1e-8) << "rooms were learnt on with narrow views";
  evidence.both_are_narrow = true;
  EXPECT_NEAR(loop_log_odds(evidence), -6.045077178, 1e-8);
  evidence.one_is_narrow = true;
  EXPECT_NEAR(loop_log_odds(evidence), -8.045077178, 1e-8);
}

TEST(LoopProbability, IntensitiesOfTwoSensorsAreComparableOrNot) {
  LoopEvidence evidence = usual_revisit();
  evidence.intensity_agreement = 0.2;
  const double with = loop_log_odds(evidence);
  evidence.sensors_differ = true;
  const double either = loop_log_odds(evidence);
  evidence.intensity_agreement.reset();
  const double without = loop_log_odds(evidence);
  ASSERT_GT(without, with + 1.0);
  EXPECT_NEAR(std::exp(either), 0.5 * (std::exp(with) + std::exp(without)), 1e-9 * std::exp(without))
      << "the mean of both odds";
}

TEST(LoopProbability, ASectorOfAStreetDecidesNothingAlone) {
  LoopEvidence evidence = usual_revisit();
  EXPECT_TRUE(evidence.decides_alone());
  evidence.both_are_narrow = true;
  EXPECT_FALSE(evidence.decides_alone());
  evidence.in_the_open = false;
  EXPECT_TRUE(evidence.decides_alone()) << "a room has a sector of its own";
  evidence.one_is_narrow = true;
  EXPECT_FALSE(evidence.decides_alone());
}

TEST(LoopProbability, RoomsAndSectorsResembleOthers) {
  LoopEvidence evidence = usual_revisit();
  EXPECT_FALSE(evidence.resembles_others());
  evidence.one_is_narrow = true;
  EXPECT_FALSE(evidence.resembles_others()) << "one sees all round, and its log odds are lowered";
  evidence.both_are_narrow = true;
  EXPECT_TRUE(evidence.resembles_others());
  evidence.both_are_narrow = evidence.in_the_open = false;
  EXPECT_TRUE(evidence.resembles_others());
}

// A room whose door is shut instead of open is another room; in the open, something drove into the way.
TEST(LoopProbability, WhatIsHiddenCountsInRooms) {
  const auto log_odds = [](bool in_the_open, double hidden_share) {
    LoopEvidence evidence = usual_revisit();
    evidence.in_the_open = in_the_open;
    evidence.hidden_share = hidden_share;
    return loop_log_odds(evidence);
  };
  EXPECT_LT(log_odds(false, 0.3), log_odds(false, 0.05));
  EXPECT_EQ(log_odds(true, 0.3), log_odds(true, 0.05));
}

// What a hand-held sensor leaves between two scans of one room, another one leaves between two rooms.
TEST(LoopProbability, InRoomsAResidualCountsAsAShareOfTheSensorsOwn) {
  const auto log_odds = [](bool in_the_open, double residual_share, double distance_m) {
    LoopEvidence evidence = usual_revisit();
    evidence.in_the_open = in_the_open;
    evidence.residual_share = residual_share;
    evidence.distance_m = distance_m;
    return loop_log_odds(evidence);
  };
  EXPECT_LT(log_odds(false, 1.5, 1.0), log_odds(false, 1.2, 1.0) - 1.0);
  EXPECT_EQ(log_odds(false, 0.5, 1.0), log_odds(false, 1.0, 1.0)) << "no scans agree better than scans of one place";
  EXPECT_EQ(log_odds(false, 1.1, 4.0), log_odds(false, 1.0, 4.0)) << "from farther away it is larger";
  EXPECT_EQ(log_odds(true, 1.5, 1.0), log_odds(true, 1.0, 1.0));
}

// A room with a glass front is in the open, its neighbour is not: they see little of each other.
TEST(LoopProbability, OfARoomAndTheOpenTheMoreCautiousJudgementCounts) {
  LoopEvidence evidence = usual_revisit();
  evidence.hidden_share = 0.6;
  const double in_the_open = loop_log_odds(evidence);
  evidence.one_in_a_room = true;
  const double both = loop_log_odds(evidence);
  EXPECT_LT(both, in_the_open - 5.0);
  evidence.in_the_open = evidence.one_in_a_room = false;
  EXPECT_DOUBLE_EQ(both, loop_log_odds(evidence));
  evidence.inlier_share = 1.1, evidence.hidden_share = 0.0, evidence.rmse_m = 0.6;  // rooms mind a residual less
  const double in_a_room = loop_log_odds(evidence);
  evidence.in_the_open = evidence.one_in_a_room = true;
  EXPECT_LT(loop_log_odds(evidence), in_a_room - 1.0);
}

TEST(LoopProbability, WithoutIntensitiesGeometryDecides) {
  LoopEvidence evidence = usual_revisit();
  evidence.intensity_agreement.reset();
  const double before = loop_log_odds(evidence);
  EXPECT_GT(before, 1.0);
  evidence.inlier_share = 0.5;
  EXPECT_LT(loop_log_odds(evidence), before);
  EXPECT_LT(probability_of(loop_log_odds({})), 0.01) << "of nothing, nothing follows";
}

}  // namespace
}  // namespace revisit
