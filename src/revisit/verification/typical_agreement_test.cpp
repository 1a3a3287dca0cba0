// SPDX-License-Identifier: Apache-2.0
#include <revisit/verification/typical_agreement.hpp>

#include <gtest/gtest.h>

#include "synthetic_world.hpp"

namespace revisit {
namespace {

using testing_support::SyntheticWorld;

// A drive along x, half a metre a scan; every second scan of `noisy` has shuffled intensities.
ScanGeometry scan_at(int i, bool has_intensity = true) {
  static const SyntheticWorld world(31);
  Scan scan = world.scan(SyntheticWorld::at(0.5 * i, 0, 0), {32, 450, -24.8, 5.0}, static_cast<unsigned>(i));
  std::vector<std::uint8_t> ground;
  for (Point& p : scan.points) {
    ground.push_back(p.z < -1.6f);
    if (!has_intensity) p.intensity = 1.f;
  }
  return ScanGeometry(thin(scan.points, ground, 1.0));
}

TEST(TypicalAgreement, HasDefaultsUntilTenPairsAreKnown) {
  TypicalAgreementEstimate estimate;
  const TypicalAgreement defaults;
  for (int i = 0; i < 9; ++i) EXPECT_TRUE(estimate.add(scan_at(i), scan_at(i + 1), planar_pose(0.5, 0, 0)));
  EXPECT_EQ(estimate.overall().in_sight_ratio, defaults.in_sight_ratio);
  EXPECT_EQ(estimate.overall().intensity_correlation, defaults.intensity_correlation);
  EXPECT_EQ(estimate.overall().residual, defaults.residual);
  EXPECT_NE(estimate.recent().in_sight_ratio, defaults.in_sight_ratio) << "the last few are known at once";
  estimate.add(scan_at(9), scan_at(10), planar_pose(0.5, 0, 0));
  EXPECT_NE(estimate.overall().in_sight_ratio, defaults.in_sight_ratio);
  EXPECT_NE(estimate.overall().residual, defaults.residual);
  EXPECT_GT(estimate.overall().intensity_correlation, 0.3);
  EXPECT_LE(estimate.overall().intensity_correlation, 1.0);
}

TEST(TypicalAgreement, APairAtAWrongPoseIsRefusedAndTeachesNothing) {
  TypicalAgreementEstimate estimate;
  EXPECT_FALSE(estimate.add(scan_at(0), scan_at(1), planar_pose(0.5, 4.0, 0.4)));
  EXPECT_EQ(estimate.pairs(), 0u);
}

TEST(TypicalAgreement, AfterAnInterruptionOnlyTheOverallOneIsKnown) {
  TypicalAgreementEstimate estimate;
  estimate.restore({0.7, 0.6}, 40);
  EXPECT_NEAR(estimate.overall().in_sight_ratio, 0.7, 1e-9);
  EXPECT_NEAR(estimate.overall().intensity_correlation, 0.6, 1e-9);
  estimate.add(scan_at(0), scan_at(1), planar_pose(0.5, 0, 0));
  EXPECT_GT(estimate.recent().in_sight_ratio, 0.8) << "the last pair";
  estimate.interrupt();
  EXPECT_NEAR(estimate.recent().in_sight_ratio, 0.7, 0.01);
}

TEST(TypicalAgreement, IsTheMeanOfRatiosAndTheMedianOfCorrelations) {
  TypicalAgreementEstimate estimate;
  estimate.restore({0.6, 0.3}, 10);
  estimate.restore({0.9, 0.8}, 20);
  EXPECT_NEAR(estimate.overall().in_sight_ratio, 0.8, 1e-9);
  EXPECT_NEAR(estimate.overall().intensity_correlation, 0.8, 1e-9);
  estimate.restore({0.8, 0.02}, 31);
  EXPECT_NEAR(estimate.overall().intensity_correlation, 0.1, 1e-9) << "as little as is believed";
  EXPECT_EQ(estimate.pairs(), 61u);
}

TEST(TypicalAgreement, TheLastPairsCountMore) {
  TypicalAgreementEstimate one, two;
  one.add(scan_at(0), scan_at(1), planar_pose(0.5, 0, 0));
  two.add(scan_at(0), scan_at(4), planar_pose(2.0, 0, 0));
  const double first = one.recent().in_sight_ratio, second = two.recent().in_sight_ratio;
  ASSERT_NE(first, second);
  one.add(scan_at(0), scan_at(4), planar_pose(2.0, 0, 0));
  EXPECT_NEAR(one.recent().in_sight_ratio, 0.7 * first + 0.3 * second, 1e-9);
}

// Where people stood still for a moment, or all walls were near, the sensor is no better than it was.
TEST(TypicalAgreement, AResidualIsThatOfTheRecordingOrMoreWhereTheLastPairsHaveMore) {
  TypicalAgreementEstimate small, large;
  small.restore({0.8, 0.6, 0.001}, 1000);
  large.restore({0.8, 0.6, 0.3}, 500);
  large.restore({0.8, 0.6, 0.6}, 500);
  EXPECT_EQ(small.overall().residual, 0.02) << "no sensor is without noise";
  EXPECT_NEAR(large.overall().residual, 0.45, 1e-9) << "the mean";
  for (TypicalAgreementEstimate* each : {&small, &large}) each->add(scan_at(0), scan_at(1), planar_pose(0.5, 0, 0));
  EXPECT_GT(small.recent().residual, 0.02);
  EXPECT_EQ(large.recent().residual, large.overall().residual);
  const double first = small.recent().residual;
  small.add(scan_at(0), scan_at(4), planar_pose(2.0, 0, 0));
  TypicalAgreementEstimate of_second;
  of_second.restore({0.8, 0.6, 0.001}, 1000);
  of_second.add(scan_at(0), scan_at(4), planar_pose(2.0, 0, 0));
  EXPECT_NEAR(small.recent().residual, 0.7 * first + 0.3 * of_second.recent().residual, 1e-9) << "a running mean";
  small.interrupt();
  EXPECT_EQ(small.recent().residual, small.overall().residual);
}

TEST(TypicalAgreement, FromTheSameSpotIntensitiesAgreeTooWellToCount) {
  TypicalAgreementEstimate estimate;
  for (int i = 0; i < 12; ++i) estimate.add(scan_at(i), scan_at(i), Pose::Identity());
  EXPECT_NE(estimate.overall().in_sight_ratio, TypicalAgreement{}.in_sight_ratio);
  EXPECT_EQ(estimate.overall().intensity_correlation, TypicalAgreement{}.intensity_correlation);
}

TEST(TypicalAgreement, IntensitiesThatSayNothingLeaveTheirDefault) {
  TypicalAgreementEstimate estimate;
  for (int i = 0; i < 12; ++i) estimate.add(scan_at(i, false), scan_at(i + 1, false), planar_pose(0.5, 0, 0));
  EXPECT_EQ(estimate.overall().intensity_correlation, TypicalAgreement{}.intensity_correlation);
}

}  // namespace
}  // namespace revisit
