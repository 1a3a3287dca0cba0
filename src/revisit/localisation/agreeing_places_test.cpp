// SPDX-License-Identifier: Apache-2.0
#include <revisit/localisation/agreeing_places.hpp>

#include <utility>

#include <gtest/gtest.h>

namespace revisit {
namespace {

TEST(AgreeingPlaces, SayMoreThanOneAndLessThanAll) {
  AgreeingPlaces places;
  EXPECT_EQ(places.log_odds(), 0.0);
  places.add(FrameId{7}, 1.0);
  EXPECT_DOUBLE_EQ(places.log_odds(), 1.0);
  places.add(FrameId{3}, 2.0);
  EXPECT_DOUBLE_EQ(places.log_odds(), 2.5) << "the likeliest counts whole";
  places.add(FrameId{9}, -1.0);
  EXPECT_DOUBLE_EQ(places.log_odds(), 2.0) << "one that hardly shows the scan there speaks against it";
  places.add(FrameId{4}, 1.0);
  EXPECT_DOUBLE_EQ(places.log_odds(), 2.5);
}

TEST(AgreeingPlaces, TheFourLikeliestCount) {
  AgreeingPlaces places;
  for (int i = 0; i < 10; ++i) places.add(FrameId{i}, i < 4 ? 1.0 : -5.0);
  EXPECT_DOUBLE_EQ(places.log_odds(), 2.5);
}

TEST(AgreeingPlaces, APlaceCountsOnce) {
  AgreeingPlaces places;
  for (const double log_odds : {1.0, 2.0, 0.5}) places.add(FrameId{5}, log_odds);
  EXPECT_DOUBLE_EQ(places.log_odds(), 2.0);
}

// As likely at two poses, one of which was tried from one place alone: either may be right.
TEST(AgreeingPlaces, AnotherPoseSpeaksAgainstIt) {
  AgreeingPlaces places;
  for (int i = 0; i < 4; ++i) places.add(FrameId{i}, 2.0);
  EXPECT_DOUBLE_EQ(places.log_odds(), 5.0);
  places.add_against(2.0);
  EXPECT_NEAR(places.log_odds(), 0.0, 0.01);
  const double before = places.log_odds();
  places.add_against(-8.0);
  EXPECT_NEAR(places.log_odds(), before, 1e-6) << "what is improbable says nothing";
}

TEST(AgreeingPlaces, APoseThatStandsOutAmongSeveralIsTrustedMore) {
  AgreeingPlaces places;
  places.add(FrameId{1}, 1.0);
  places.add(FrameId{2}, 0.0);
  for (int i = 0; i < 5; ++i) places.add_against(-20.0);
  EXPECT_NEAR(places.log_odds(), 1.0, 1e-6) << "five others are too few";
  places.add_against(-30.0);
  EXPECT_NEAR(places.log_odds(), 6.0, 1e-6);
  for (const auto& [other, more] : {std::pair{-15.0, 5.0}, {-11.0, 2.5}, {-7.0, 0.0}, {-30.0, 0.0}}) {
    places.add_against(other);
    EXPECT_NEAR(places.log_odds(), 1.0 + more, 1e-6) << "the likeliest of the others counts: " << other;
  }
}

TEST(AgreeingPlaces, SayNothingWithoutAPlace) {
  AgreeingPlaces places;
  for (int i = 0; i < 6; ++i) places.add_against(1.0);
  EXPECT_EQ(places.log_odds(), 0.0);
}

}  // namespace
}  // namespace revisit
