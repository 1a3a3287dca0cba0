// SPDX-License-Identifier: Apache-2.0
#include <revisit/pipeline/detection_front_end.hpp>

#include <gtest/gtest.h>

#include "synthetic_world.hpp"

namespace revisit {
namespace {

using testing_support::SyntheticWorld;

Pose pose_of(int i) { return SyntheticWorld::at(0.6 * i, 0.0, 0.01 * i); }

Scan scan_of(unsigned world, int i) {
  static const SyntheticWorld here(31), elsewhere(77);
  Scan scan = (world == 31 ? here : elsewhere).scan(pose_of(i), {32, 600, -24.8, 5.0}, static_cast<unsigned>(i));
  scan.frame = FrameId{i};
  scan.stamp_s = 0.1 * i;
  return scan;
}

Scan nothing_at(int i) {
  Scan scan;
  scan.frame = FrameId{i};
  scan.stamp_s = 0.1 * i;
  return scan;
}

// Twelve scans of a drive, those that `between` gives, and the twentieth scan of the drive.
std::pair<TrajectoryPoint, TrajectoryPoint> before_and_after(Scan (*between)(int)) {
  DetectionFrontEnd front_end(Parameters{}, std::nullopt, {}, {});
  const auto point_of = [&](Scan scan) {
    const auto step = front_end.step(std::move(scan));
    return step ? *step->scan.trajectory_point : TrajectoryPoint{};
  };
  TrajectoryPoint before;
  for (int i = 0; i < 12; ++i) before = point_of(scan_of(31, i));
  for (int i = 12; i < 20; ++i) {
    if (i < 14 || i > 16)
      point_of(scan_of(31, i));
    else
      point_of(between(i));
  }
  return {before, point_of(scan_of(31, 20))};
}

TEST(DetectionFrontEnd, ScansThatDescribeNoPlaceAreAGapNotALoss) {
  const auto [before, after] = before_and_after(nothing_at);
  EXPECT_EQ(after.origin, before.origin);
  EXPECT_GT(after.segment, before.segment);
  EXPECT_GT(after.gaps_m2, 0.2);
  EXPECT_LT(after.gaps_m2, 4.0);
  const Pose error = (pose_of(11).inverse() * pose_of(20)).inverse() * T_between(before, after);
  EXPECT_LT(error.translation().norm(), 0.2) << "over 5.4 m";
}

TEST(DetectionFrontEnd, ScansOfElsewhereAreAGapUntilTrackIsLost) {
  const auto [before, after] = before_and_after([](int i) { return scan_of(77, i); });
  EXPECT_EQ(after.origin, before.origin);
  EXPECT_GT(after.gaps_m2, 0.2);
}

}  // namespace
}  // namespace revisit
