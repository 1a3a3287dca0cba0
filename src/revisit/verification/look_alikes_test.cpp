// SPDX-License-Identifier: Apache-2.0
#include <revisit/verification/look_alikes.hpp>

#include <cmath>

#include <gtest/gtest.h>

namespace revisit {
namespace {

// Scores that fall off exponentially from `begin` on, in steps that cover the distribution evenly.
LookAlikes with_scores(double begin, double scale, int count) {
  LookAlikes alike;
  for (int i = 0; i < count; ++i) {
    const double share = (static_cast<double>((i * 37) % count) + 0.5) / count;
    alike.add(begin - scale * std::log(share));
  }
  return alike;
}

TEST(LookAlikes, SayNothingUntilEnoughIsKnown) {
  EXPECT_EQ(LookAlikes().log_odds(), 0.0);
  EXPECT_EQ(with_scores(5.0, 1.0, 29).log_odds(), 0.0);
  EXPECT_LT(with_scores(5.0, 1.0, 31).log_odds(), -0.9);
}

TEST(LookAlikes, TheMoreWrongPlacesReachTheMoreIsAsked) {
  EXPECT_EQ(with_scores(-15.0, 1.5, 300).log_odds(), 0.0) << "places that are not alike bring nothing";
  EXPECT_LT(with_scores(-4.0, 1.2, 300).log_odds(), -0.5);
  EXPECT_LT(with_scores(-2.0, 1.5, 300).log_odds(), -1.5);
  EXPECT_GE(with_scores(20.0, 3.0, 300).log_odds(), -4.0) << "never so much that nothing passes";
}

// Scores up to a limit and none beyond, as of rows of like houses: an exponential tail would expect higher ones.
TEST(LookAlikes, InAMapWhatIsAlikeHasAnEnd) {
  const auto up_to = [](double most) {
    LookAlikes alike;
    for (int i = 0; i < 120; ++i) alike.add(most - 20.0 * ((i * 37) % 120 + 0.5) / 120.0);
    return alike;
  };
  EXPECT_LT(up_to(2.0).log_odds(), -0.5);
  EXPECT_NEAR(up_to(2.0).log_odds_in_map(), 0.0, 0.3);
  EXPECT_NEAR(up_to(3.5).log_odds_in_map(), -1.2, 0.3) << "less a fifth, since there are few scores";
  EXPECT_GT(with_scores(-15.0, 1.5, 300).log_odds_in_map(), 2.0) << "nothing is alike";
}

// Twenty scores a fifth apart; of them the highest eighth makes the tail, and what is usual counts as thirty more.
TEST(LookAlikes, TheEndOfTheTailIsThatOfItsMeanExcess) {
  LookAlikes alike;
  for (int i = 0; i < 40; ++i) alike.add(-3.0 + 0.2 * i);  // up to 4.8, the tail from 3.2 on: eight with a mean of 0.9
  const double end = 3.2 - 0.9 * std::log(1e-3 * 40.0 / 8.0);
  EXPECT_NEAR(alike.log_odds(), 40.0 / 70.0 * std::max(-3.0, 3.0 - end), 1e-9);
  LookAlikes rarely = LookAlikes();
  for (int i = 0; i < 40; ++i) rarely.add(-9.0 + 0.2 * i);
  EXPECT_EQ(rarely.log_odds(), 0.0);
  EXPECT_NEAR(rarely.log_odds_in_map(), 40.0 / 70.0 * (3.0 - (end - 6.0)), 1e-9) << "less is asked in a map alone";
}

TEST(LookAlikes, WhatWasNotWorthRegisteringMakesNoTail) {
  LookAlikes alike;
  for (int i = 0; i < 200; ++i) alike.add(LookAlikes::kNotRegistered);
  for (int i = 0; i < 5; ++i) alike.add(6.0);
  EXPECT_EQ(alike.log_odds(), 0.0);
}

TEST(LookAlikes, TheLastScoresCount) {
  LookAlikes alike = with_scores(-20.0, 0.5, 400);
  const double before = alike.log_odds();
  for (int i = 0; i < 400; ++i) alike.add(4.0 + 0.001 * i);
  EXPECT_EQ(before, 0.0);
  EXPECT_LT(alike.log_odds(), 0.0);
}

}  // namespace
}  // namespace revisit
