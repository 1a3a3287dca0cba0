// SPDX-License-Identifier: Apache-2.0
#include <revisit/verification/loop_probability.hpp>

#include <gtest/gtest.h>

namespace revisit {
namespace {

LoopEvidence usual_revisit() { return {0.8, 0.95, 0.985, 0.95, 0.12, 0.82, 1.0, 1.0}; }

TEST(LoopProbability, AUsualRevisitIsSureAndALookAlikeIsNot) {
  EXPECT_GT(probability_of(loop_log_odds(usual_revisit())), 0.98);
  LoopEvidence look_alike = usual_revisit();
  look_alike.inlier_share = 0.7;
  look_alike.free_space_agreement = 0.955;
  look_alike.rmse_m = 0.18;
  look_alike.overlap = 0.7;
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
  EXPECT_LT(after([](LoopEvidence& e) { e.free_space_agreement -= 0.02; }), before);
  EXPECT_LT(after([](LoopEvidence& e) { *e.intensity_agreement -= 0.1; }), before);
  EXPECT_LT(after([](LoopEvidence& e) { e.rmse_m += 0.02; }), before);
  EXPECT_LT(after([](LoopEvidence& e) { e.overlap -= 0.1; }), before);
  EXPECT_LT(after([](LoopEvidence& e) { e.horizon = 0.2; }), before - 3.0) << "a narrow view";
  EXPECT_GT(after([](LoopEvidence& e) { e.distance_m += 4.0; }), before) << "from afar less must fit";
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
