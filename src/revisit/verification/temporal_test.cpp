// SPDX-License-Identifier: Apache-2.0
#include <revisit/verification/temporal.hpp>

#include <map>

#include <gtest/gtest.h>

#include <revisit/descriptors/similarity.hpp>

#include "random_points.hpp"

namespace revisit {
namespace {

IntensityScanContext place(unsigned seed) { return describe(testing_support::random_points(500, seed), {}); }

// A drive over the places 0..9, later again: forward as frames 100..109, and backward as frames 200..209.
class TemporalConsistency : public testing::Test {
 protected:
  TemporalConsistency() {
    for (int i = 0; i < 10; ++i) {
      descriptors_[FrameId{i}] = place(static_cast<unsigned>(i));
      descriptors_[FrameId{100 + i}] = place(static_cast<unsigned>(i));
      descriptors_[FrameId{200 + i}] = place(static_cast<unsigned>(9 - i));
    }
  }
  TemporalEvidence check(int query, int match, double min_score = 1.8) const {
    const DescriptorLookup lookup = [this](FrameId frame) -> std::optional<DescriptorView> {
      const auto found = descriptors_.find(frame);
      if (found == descriptors_.end()) return std::nullopt;
      return found->second;
    };
    TemporalOptions options;
    options.min_score = min_score;
    return check_temporal(FrameId{query}, FrameId{match}, lookup, lookup, options);
  }
  std::map<FrameId, IntensityScanContext> descriptors_;
};

TEST_F(TemporalConsistency, ForwardVisit) {
  const TemporalEvidence evidence = check(107, 7);
  EXPECT_EQ(evidence.forward_pairs, 5);
  EXPECT_NEAR(evidence.score, 2.0, 1e-9);
  EXPECT_FALSE(evidence.reverse);
  EXPECT_FALSE(evidence.refusal);
}

TEST_F(TemporalConsistency, ReverseVisitRunsTheCandidatesIndexTheOtherWay) {
  const TemporalEvidence evidence = check(206, 3);  // frame 206 is place 3; frames before it are places 4, 5, ...
  EXPECT_TRUE(evidence.reverse);
  EXPECT_NEAR(evidence.score, 2.0, 1e-9);
  EXPECT_LT(evidence.forward_score, 1.8);
}

TEST_F(TemporalConsistency, AWrongPlaceIsRefusedWithItsScore) {
  const TemporalEvidence evidence = check(107, 2);
  ASSERT_TRUE(evidence.refusal);
  EXPECT_EQ(evidence.refusal->reason, Refusal::Reason::kTemporallyInconsistent);
  EXPECT_DOUBLE_EQ(evidence.refusal->value, evidence.score);
  EXPECT_DOUBLE_EQ(evidence.refusal->limit, 1.8);
  EXPECT_FALSE(check(107, 2, 0.0).refusal) << "a threshold of 0 never refuses";
}

TEST_F(TemporalConsistency, IsThePlainMeanOfThePairsThatExist) {
  double sum = 0.0;
  for (int k = 1; k <= 2; ++k)  // frames before 0 do not exist
    sum += match_descriptors(descriptors_.at(FrameId{108 - k}), descriptors_.at(FrameId{2 - k})).score();
  const TemporalEvidence evidence = check(108, 2);
  EXPECT_EQ(evidence.forward_pairs, 2);
  EXPECT_DOUBLE_EQ(evidence.forward_score, sum / 2.0);
}

TEST_F(TemporalConsistency, WithoutPairsThereIsNothingToRefuseBy) {
  const TemporalEvidence evidence = check(100, 5);  // frames 95..99 do not exist
  EXPECT_EQ(evidence.forward_pairs + evidence.reverse_pairs, 0);
  EXPECT_FALSE(evidence.refusal);
}

}  // namespace
}  // namespace revisit
