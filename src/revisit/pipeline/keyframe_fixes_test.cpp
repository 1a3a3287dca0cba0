// SPDX-License-Identifier: Apache-2.0
#include <revisit/pipeline/keyframe_fixes.hpp>

#include <limits>

#include <gtest/gtest.h>

namespace revisit {
namespace {

GpsFix fix_at(double stamp_s) {
  return {stamp_s, 48.0 + 1e-5 * stamp_s, 11.0, 500.0 + stamp_s, Eigen::Vector3d(1.0, 2.0, 3.0)};
}

Eigen::Vector3d along(double x_m) { return {x_m, 0.0, 0.0}; }

TEST(KeyframeFixes, LieBetweenTwoFixes) {
  KeyframeFixes fixes;
  fixes.set({fix_at(1.0), fix_at(2.0), fix_at(4.0)});
  EXPECT_FALSE(fixes.fix_of(FrameId{0}, 0.9, along(0.0))) << "before the first";
  const auto fix = fixes.fix_of(FrameId{1}, 1.25, along(100.0));
  ASSERT_TRUE(fix);
  EXPECT_NEAR(fix->latitude_deg, 48.0000125, 1e-12);
  EXPECT_NEAR(fix->altitude_m, 501.25, 1e-9);
  EXPECT_EQ(fix->deviation_m, Eigen::Vector3d(1.0, 2.0, 3.0));
  EXPECT_FALSE(fixes.fix_of(FrameId{2}, 1.5, along(109.0))) << "beside the one before";
  EXPECT_TRUE(fixes.fix_of(FrameId{3}, 1.5, along(111.0)));
  EXPECT_FALSE(fixes.fix_of(FrameId{4}, 3.0, along(200.0))) << "two seconds without a fix";
}

TEST(KeyframeFixes, AKeyFrameWaitsForTheFixAfterIt) {
  KeyframeFixes fixes;
  EXPECT_TRUE(fixes.add(fix_at(1.0)).empty());
  EXPECT_FALSE(fixes.fix_of(FrameId{7}, 1.5, along(0.0)));
  EXPECT_FALSE(fixes.fix_of(FrameId{8}, 2.6, along(0.0))) << "the next will come too late for it";
  const auto waited = fixes.add(fix_at(2.0));
  ASSERT_EQ(waited.size(), 1u);
  EXPECT_EQ(waited[0].first, FrameId{7});
  EXPECT_TRUE(fixes.fix_of(waited[0].first, waited[0].second, along(0.0)));
  EXPECT_TRUE(fixes.add(fix_at(3.0)).empty()) << "nobody waits any longer";
}

TEST(KeyframeFixes, AClockThatIsSetBackBeginsAnew) {
  KeyframeFixes fixes;
  (void)fixes.add(fix_at(100.0));
  EXPECT_FALSE(fixes.fix_of(FrameId{1}, 100.5, along(0.0)));
  EXPECT_TRUE(fixes.add(fix_at(95.0)).empty()) << "late, and ignored";
  EXPECT_EQ(fixes.add(fix_at(101.0)).size(), 1u);
  (void)fixes.add(fix_at(50.0));
  (void)fixes.add(fix_at(51.0));
  EXPECT_TRUE(fixes.fix_of(FrameId{2}, 50.5, along(0.0)));
}

TEST(KeyframeFixes, NonsenseGivesNone) {
  constexpr double kNothing = std::numeric_limits<double>::quiet_NaN();
  GpsFix beyond = fix_at(2.0), nowhere = fix_at(2.0), west = fix_at(2.0);
  beyond.latitude_deg = 1e3;
  nowhere.altitude_m = kNothing;
  west.longitude_deg = -179.9;
  for (const GpsFix& wrong : {beyond, nowhere, west}) {
    KeyframeFixes fixes;
    fixes.set({fix_at(1.0), wrong});
    EXPECT_FALSE(fixes.fix_of(FrameId{1}, 1.9, along(0.0)));
  }
  GpsFix a = fix_at(1.0), b = fix_at(2.0);
  a.deviation_m = {0.0, kNothing, 1e9};
  b.deviation_m = {0.0, kNothing, 1e9};
  KeyframeFixes fixes;
  fixes.set({a, b});
  const auto fix = fixes.fix_of(FrameId{1}, 1.5, along(0.0));
  ASSERT_TRUE(fix);
  EXPECT_EQ(fix->deviation_m, Eigen::Vector3d(5.0, 5.0, 1e4)) << "unknown is 5 m";
}

}  // namespace
}  // namespace revisit
