// SPDX-License-Identifier: Apache-2.0
#include <revisit/verification/hypothesis.hpp>

#include <gtest/gtest.h>

namespace revisit {
namespace {

Hypothesis seen_from_overhead() {
  Hypothesis hypothesis;
  hypothesis.candidate.geometry_score = 0.4;
  hypothesis.overlap = 0.8;
  return hypothesis;
}

Hypothesis registered(double own_log_odds, double distance_m, bool is_refused) {
  Hypothesis hypothesis = seen_from_overhead();
  hypothesis.geometric.emplace();
  hypothesis.geometric->own_log_odds = own_log_odds;
  hypothesis.geometric->T_match_query.translation().x() = distance_m;
  if (is_refused) hypothesis.refusal = Refusal{Refusal::Reason::kImprobable, 0.0, 0.0};
  return hypothesis;
}

TEST(Hypothesis, ScoreGrowsWithWhatRegistrationSays) {
  EXPECT_DOUBLE_EQ(seen_from_overhead().score(), 0.3);
  EXPECT_DOUBLE_EQ(registered(0.0, 10.0, true).score(), 0.3 + 0.5) << "as likely as not";
  EXPECT_NEAR(registered(12.0, 10.0, true).score(), 0.3 + 0.881, 1e-3);
  EXPECT_NEAR(registered(-12.0, 10.0, true).score(), 0.3 + 0.119, 1e-3);
}

TEST(Hypothesis, ALoopAtTheSamePlaceComesFirst) {
  EXPECT_DOUBLE_EQ(registered(0.0, 10.0, false).score(), 0.8 + 1.0);
  EXPECT_DOUBLE_EQ(registered(0.0, 1.0, false).score(), 0.8 + 2.0);
  EXPECT_DOUBLE_EQ(registered(0.0, 3.75, false).score(), 0.8 + 1.5) << "half a step before the limit";
  EXPECT_DOUBLE_EQ(registered(0.0, 1.0, true).score(), 0.8 + 0.2) << "refused, and yet";
}

}  // namespace
}  // namespace revisit
