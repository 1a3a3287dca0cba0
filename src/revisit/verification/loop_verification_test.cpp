// SPDX-License-Identifier: Apache-2.0
#include <revisit/verification/loop_verification.hpp>

#include <algorithm>
#include <map>
#include <optional>
#include <random>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "remembered_places.hpp"

namespace revisit {
namespace {

using testing_support::described;
using testing_support::Described;
using testing_support::SyntheticWorld;
using LoopVerificationTest = testing_support::RememberedPlaces;

TEST_F(LoopVerificationTest, TheRightCandidateWinsWhereverItStandsInTheList) {
  const Described query = described(home_, SyntheticWorld::at(2.2, 0.3, 3.0));
  const VerificationQuery question{FrameId{1000}, query.descriptor, query.cloud, nullptr, std::nullopt};
  const VerificationContext known = context();
  LoopVerification verification(known, question);
  const auto answer = verification.verify(candidates(query, {90, 2}));
  ASSERT_TRUE(answer && *answer);
  EXPECT_TRUE((*answer)->is_accepted());
  EXPECT_EQ((*answer)->candidate.match, FrameId{2});
  EXPECT_GE(verification.hypotheses().size(), 2u);
}

TEST_F(LoopVerificationTest, AnotherWorldIsRefusedForItsOverlapOrItsInliers) {
  const Described query = described(home_, SyntheticWorld::at(2.2, 0.3, 0.0));
  const VerificationQuery question{FrameId{1000}, query.descriptor, query.cloud, nullptr, std::nullopt};
  for (const double min_overlap : {0.4, 0.0}) {
    parameters_.geometric.min_overlap = min_overlap;
    const VerificationContext known = context();
    LoopVerification verification(known, question);
    const auto answer = verification.verify(candidates(query, {90}));
    ASSERT_TRUE(answer && *answer);
    ASSERT_TRUE((*answer)->refusal);
    EXPECT_EQ((*answer)->refusal->reason,
              min_overlap > 0.0 ? Refusal::Reason::kLowOverlap : Refusal::Reason::kFewInliers);
    EXPECT_EQ((*answer)->geometric.has_value(), min_overlap == 0.0) << "registered only where it is worth it";
  }
}

TEST_F(LoopVerificationTest, OfTwoPlacesThatFitEquallyWellNoneIsSure) {
  add(80, described(home_, SyntheticWorld::at(2, 0, 0)), points_.at(FrameId{0})->after(planar_pose(40, 0, 0)));
  const Described query = described(home_, SyntheticWorld::at(2.2, 0.3, 3.0));
  const VerificationQuery question{FrameId{1000}, query.descriptor, query.cloud, nullptr, std::nullopt};
  const VerificationContext known = context();
  for (const int only : {2, 80}) {
    LoopVerification verification(known, question);
    const auto answer = verification.verify(candidates(query, {only}));
    ASSERT_TRUE(answer && *answer);
    EXPECT_TRUE((*answer)->is_accepted()) << only;
  }
  LoopVerification verification(known, question);
  const auto answer = verification.verify(candidates(query, {2, 80}));
  ASSERT_TRUE(answer && *answer && (*answer)->refusal);
  EXPECT_EQ((*answer)->refusal->reason, Refusal::Reason::kImprobable) << "by odometry, they are 38 m apart";
  EXPECT_NEAR((*answer)->geometric->probability, 0.5, 0.1);
}

TEST_F(LoopVerificationTest, OfAFarAnswerAndANearerPlaceTheNearerOneIsTested) {
  const Described query = described(home_, SyntheticWorld::at(5.0, 0, 0));
  const VerificationQuery question{FrameId{1000}, query.descriptor, query.cloud, nullptr, std::nullopt};
  const VerificationContext known = context();
  LoopVerification verification(known, question);
  const auto answer = verification.verify(candidates(query, {1}));
  ASSERT_TRUE(answer && *answer);
  EXPECT_EQ((*answer)->candidate.match, FrameId{5}) << "odometry connects the places: 5 is 4 m nearer";
  EXPECT_LT((*answer)->distance_m(), 0.1);
}

TEST_F(LoopVerificationTest, ALaterLoopLeadsBackUnlessAnotherPoseWasAsSure) {
  const TrajectoryPoint now{.segment = 7}, later = now.after(planar_pose(1, 0, 0));
  following_.add(later, FrameId{4}, *points_.at(FrameId{4}), planar_pose(0, 0.1, 0), 12.0);
  const Described query = described(home_, SyntheticWorld::at(3.0, 0.1, 0));
  const VerificationQuery question{FrameId{1001}, query.descriptor, query.cloud, nullptr, now};
  const VerificationContext known = context();
  LoopVerification verification(known, question);
  const auto answer = verification.verify_again({});
  ASSERT_TRUE(answer && *answer);
  EXPECT_TRUE((*answer)->is_accepted());
  EXPECT_EQ((*answer)->candidate.match, FrameId{3});
  EXPECT_EQ(verification.hypotheses().size(), 1u);
  // The same pose, found from another place, is no other; one 4 m away is.
  for (const auto& [at_m, is_accepted] : {std::pair{2.0, true}, {-2.0, false}}) {
    const RegisteredPose registered{FrameId{1}, planar_pose(at_m, 0.1, 0), (*answer)->geometric->log_odds};
    LoopVerification against(known, question);
    const auto doubted = against.verify_again({&registered, 1});
    ASSERT_TRUE(doubted && *doubted);
    EXPECT_EQ((*doubted)->is_accepted(), is_accepted) << at_m;
    EXPECT_EQ(against.hypotheses().size(), 1u) << "what was registered then is not tested again";
  }
  const VerificationQuery lost{FrameId{1001}, query.descriptor, query.cloud, nullptr, TrajectoryPoint{.segment = 8}};
  LoopVerification out_of_reach(known, lost);
  EXPECT_FALSE(*out_of_reach.verify_again({}));
}

TEST_F(LoopVerificationTest, AScanPreparedAnewIsRegisteredWhereItFittedBest) {
  const Described blurred = described(home_, SyntheticWorld::at(2.2, 0.3, 0.0));
  const Described query = described(home_, SyntheticWorld::at(2.4, 0.3, 0.0));
  const VerificationQuery before{FrameId{1000}, blurred.descriptor, blurred.cloud, nullptr, std::nullopt};
  const VerificationQuery now{FrameId{1000}, query.descriptor, query.cloud, nullptr, std::nullopt};
  parameters_.geometric.min_overlap = 0.0;
  const VerificationContext known = context();
  LoopVerification first(known, before), second(known, now);
  ASSERT_TRUE(first.verify(candidates(blurred, {2, 90})));
  const auto of = [](const LoopVerification& verification, int place) {
    return *std::find_if(verification.hypotheses().begin(), verification.hypotheses().end(),
                         [&](const Hypothesis& each) { return each.candidate.match == FrameId{place}; });
  };
  ASSERT_TRUE(of(first, 90).geometric) << "another world, which fits far less well";
  const auto answer = second.verify_there(first.hypotheses());
  ASSERT_TRUE(answer && *answer);
  EXPECT_TRUE((*answer)->is_accepted());
  EXPECT_EQ((*answer)->candidate.match, FrameId{2});
  EXPECT_NEAR(of(second, 2).geometric->T_match_query.translation().x(), 0.4, 0.05);
  EXPECT_EQ(of(second, 90).geometric->T_match_query.matrix(), of(first, 90).geometric->T_match_query.matrix());
  // What is not registered anew is no answer, though it was accepted before.
  std::vector<Hypothesis> misled = first.hypotheses();
  for (Hypothesis& each : misled)
    if (each.candidate.match == FrameId{90}) each.geometric->own_log_odds = 100.0;
  for (const double look_alikes_log_odds : {0.0, -2.0}) {
    VerificationContext cautious = context();
    cautious.look_alikes_log_odds = look_alikes_log_odds;
    LoopVerification third(cautious, now);
    const auto none = third.verify_there(misled);
    ASSERT_TRUE(none && *none);
    EXPECT_FALSE((*none)->is_accepted());
  }
  LoopVerification nowhere(known, now);
  EXPECT_FALSE(*nowhere.verify_there({}));
}

TEST_F(LoopVerificationTest, AFollowedLoopIsTestedFirstAndAlone) {
  const TrajectoryPoint before{.segment = 7}, now = before.after(planar_pose(1, 0, 0));
  following_.add(before, FrameId{2}, *points_.at(FrameId{2}), Pose::Identity(), 12.0);
  const Described query = described(home_, SyntheticWorld::at(3.0, 0.1, 0));
  const VerificationQuery question{FrameId{1001}, query.descriptor, query.cloud, nullptr, now};
  const VerificationContext known = context();
  LoopVerification verification(known, question);
  const auto answer = verification.verify(candidates(query, {0, 90}));
  ASSERT_TRUE(answer && *answer);
  EXPECT_EQ((*answer)->candidate.match, FrameId{3});
  EXPECT_EQ(verification.hypotheses().size(), 1u) << "sure and near: no candidate is tested";
  parameters_.geometric.follow = false;
  const VerificationContext without = context();
  LoopVerification alone(without, question);
  ASSERT_TRUE(alone.verify(candidates(query, {0, 90})));
  EXPECT_GE(alone.hypotheses().size(), 2u);
}

TEST_F(LoopVerificationTest, AFollowedLoopThatIsFarAwayOrUnsureIsTestedBesideTheCandidates) {
  const TrajectoryPoint before{.segment = 7}, now = before.after(planar_pose(1, 0, 0));
  const Described query = described(home_, SyntheticWorld::at(5.0, 1.9, 0));
  const VerificationQuery question{FrameId{1001}, query.descriptor, query.cloud, nullptr, now};
  following_.add(before, FrameId{4}, *points_.at(FrameId{4}), planar_pose(0, 1.9, 0), 12.0);
  const VerificationContext known = context();
  LoopVerification verification(known, question);
  const auto answer = verification.verify(candidates(query, {90}));
  ASSERT_TRUE(answer && *answer);
  EXPECT_EQ((*answer)->candidate.match, FrameId{5});
  EXPECT_EQ(verification.hypotheses().back().candidate.match, FrameId{5}) << "1.9 m away: a candidate may be nearer";
  EXPECT_GE(verification.hypotheses().size(), 2u);
  LoopVerification once(known, question);
  ASSERT_TRUE(once.verify(candidates(query, {5})));
  EXPECT_EQ(once.hypotheses().size(), CandidateRegistration::kPosesAPlace) << "retrieval answered it, too";

  following_ = {};
  following_.add(before, FrameId{5}, *points_.at(FrameId{5}), planar_pose(6.0, 0, 0), 12.0);
  LoopVerification out_of_reach(known, question);
  EXPECT_FALSE(*out_of_reach.verify_again({})) << "7 m from the last place";
}

TEST_F(LoopVerificationTest, WhatStandsOutFromLookAlikesNeedsLessCautionInAMap) {
  const Described query = described(home_, SyntheticWorld::at(2.2, 0.3, 0.0));
  const auto own_log_odds = [&](double look_alikes, const std::optional<TrajectoryPoint>& point) {
    VerificationContext known = context();
    known.look_alikes_log_odds = look_alikes;
    const VerificationQuery question{FrameId{1000}, query.descriptor, query.cloud, nullptr, point};
    LoopVerification verification(known, question);
    return verification.verify(candidates(query, {2})).operator*()->own_log_odds();
  };
  const double usual = own_log_odds(0.0, std::nullopt);
  EXPECT_NEAR(own_log_odds(2.0, std::nullopt), usual + 2.0, 1e-9) << "nothing is alike: no caution to take away";
  EXPECT_NEAR(own_log_odds(-2.0, std::nullopt), usual - 0.4, 1e-9) << "nothing else fits: a fifth of it is left";
  EXPECT_NEAR(own_log_odds(-2.0, TrajectoryPoint{.segment = 9}), usual - 2.0, 1e-9) << "on a drive all of it";
}

TEST_F(LoopVerificationTest, TheLessAPoseStandsOutTheMoreCautionIsLeft) {
  add(80, described(home_, SyntheticWorld::at(5.0, 0.6, 0)), points_.at(FrameId{0})->after(planar_pose(40, 0, 0)));
  const Described query = described(home_, SyntheticWorld::at(2.2, 0.3, 0.0));
  const auto own_log_odds = [&](double look_alikes) {
    VerificationContext known = context();
    known.look_alikes_log_odds = look_alikes;
    const VerificationQuery question{FrameId{1000}, query.descriptor, query.cloud, nullptr, std::nullopt};
    LoopVerification verification(known, question);
    EXPECT_TRUE(verification.verify(candidates(query, {2, 80})));
    std::map<FrameId, double> most;
    for (const Hypothesis& each : verification.hypotheses())
      if (each.geometric)
        most[each.candidate.match] =
            std::max(most.try_emplace(each.candidate.match, -1e9).first->second, each.own_log_odds());
    return most;
  };
  const auto usual = own_log_odds(0.0), cautious = own_log_odds(-2.0);
  const double ahead = usual.at(FrameId{2}) - usual.at(FrameId{80});
  ASSERT_GT(ahead, 0.5);
  ASSERT_LT(ahead, 7.5);
  EXPECT_NEAR(cautious.at(FrameId{2}), usual.at(FrameId{2}) - 2.0 * (1.0 - 0.8 * ahead / 8.0), 1e-6);
  EXPECT_NEAR(cautious.at(FrameId{80}), usual.at(FrameId{80}) - 2.0, 1e-6) << "it stands behind";
}

// From overhead two places look more like the scan than its own does: what stands there stands within a metre or so of
// where it ought to.
TEST_F(LoopVerificationTest, AScanAloneIsRegisteredWithFurtherPlacesWhereTheBestDoNotFit) {
  const Pose T_world_query = SyntheticWorld::at(4.6, 0.9, 0.0);
  const Described query = described(home_, T_world_query);
  std::mt19937 random(1);
  std::uniform_real_distribution<float> off(-1.2f, 1.2f);
  for (const int decoy : {71, 72}) {
    Scan scan = home_.scan(T_world_query, {32, 900, -24.8, 5.0});
    std::vector<std::uint8_t> ground;
    for (Point& p : scan.points) {
      ground.push_back(p.z < -1.6f);
      p.x += off(random), p.y += off(random), p.z += off(random);
    }
    add(decoy, {describe(scan.points, {}), thin_for_registration(scan.points, ground)}, std::nullopt);
  }
  parameters_.geometric.candidates = 2;
  const VerificationContext known = context();
  for (const bool is_alone : {true, false}) {
    const VerificationQuery question{FrameId{1000}, query.descriptor, query.cloud, nullptr,
                                     is_alone ? std::nullopt : std::optional(TrajectoryPoint{.segment = 9})};
    LoopVerification verification(known, question);
    const auto answer = verification.verify(candidates(query, {71, 72, 0}));
    ASSERT_TRUE(answer && *answer);
    EXPECT_EQ((*answer)->is_accepted(), is_alone);
    if (is_alone) {
      EXPECT_LT((*answer)->candidate.match, FrameId{6});
    } else {
      EXPECT_EQ(verification.hypotheses().size(), 2u) << "on a drive the next scan comes soon";
    }
  }
}

TEST_F(LoopVerificationTest, APlaceThatCannotBeReadIsAnError) {
  const Described query = described(home_, SyntheticWorld::at(2.2, 0.3, 0.0));
  const VerificationQuery question{FrameId{1000}, query.descriptor, query.cloud, nullptr, std::nullopt};
  const VerificationContext known = context();
  LoopVerification verification(known, question);
  auto unknown = candidates(query, {2});
  unknown[0].match = FrameId{55};
  EXPECT_FALSE(verification.verify(unknown));
  EXPECT_FALSE(verification.verify({}).operator*().has_value()) << "no candidates, no answer";
}

}  // namespace
}  // namespace revisit
