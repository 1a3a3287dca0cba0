// SPDX-License-Identifier: Apache-2.0
#include <revisit/odometry/imu_trust.hpp>

#include <gtest/gtest.h>

namespace revisit {
namespace {

Pose turned(double deg) { return planar_pose(0.1, 0.0, to_radians(deg)); }

// Turns to and fro by `turn_deg` a scan, of which the IMU says `factor` times as much and `off_deg` more.
ImuTrust after(int scans, double turn_deg, double factor, double off_deg) {
  ImuTrust trust;
  for (int i = 0; i < scans; ++i) {
    const double deg = i % 2 == 0 ? turn_deg : -turn_deg;
    trust.compare(turned(factor * deg + off_deg), turned(deg));
  }
  return trust;
}

TEST(ImuTrust, GrowsWithTwentyTurnsThatAgree) {
  EXPECT_FALSE(after(10, 3.0, 1.0, 0.05).is_trusted());
  EXPECT_TRUE(after(20, 3.0, 1.0, 0.05).is_trusted());
  EXPECT_NEAR(to_degrees(after(200, 3.0, 1.0, 0.05).stddev_rad()), 0.29, 0.01);
  EXPECT_NEAR(to_degrees(after(200, 3.0, 1.0, 0.4).stddev_rad()), 0.115 + 1.5 * 0.4, 0.1);
}

TEST(ImuTrust, IsNotGivenToWhatIsWrongOrWasNotTried) {
  EXPECT_FALSE(after(200, 3.0, -1.0, 0.0).is_trusted()) << "other axes";
  EXPECT_FALSE(after(200, 3.0, 57.3, 0.0).is_trusted()) << "degrees a second";
  EXPECT_FALSE(after(200, 3.0, 0.0, 0.0).is_trusted()) << "it says nothing at all";
  EXPECT_FALSE(after(200, 0.3, 1.0, 0.0).is_trusted()) << "it went straight on";
}

TEST(ImuTrust, IsLostAgain) {
  ImuTrust trust = after(200, 3.0, 1.0, 0.0);
  for (int i = 0; i < 20; ++i) trust.compare(turned(0.0), turned(4.0));
  EXPECT_FALSE(trust.is_trusted());
}

}  // namespace
}  // namespace revisit
