// SPDX-License-Identifier: Apache-2.0
#include <revisit/odometry/odometry.hpp>

#include <gtest/gtest.h>

#include "synthetic_world.hpp"

namespace revisit {
namespace {

using testing_support::SyntheticWorld;

constexpr double kPeriod_s = 0.1;

// Along a bend, 0.8 m a scan: the pose at any moment, in scans.
Pose pose_at(double i) { return SyntheticWorld::at(0.8 * i, 0.01 * i * i, 0.02 * i); }

// A scan whose points were seen one after the other while the sensor moved: the stamp is at its end.
Scan swept_scan(int i, bool is_swept = true) {
  static const SyntheticWorld world(31);
  Scan scan = world.scan(pose_at(i), {32, 600, -24.8, 5.0}, static_cast<unsigned>(i));
  scan.frame = FrameId{i};
  scan.stamp_s = kPeriod_s * i;
  if (!is_swept) return scan;
  for (Point& p : scan.points) {
    const double share = std::atan2(p.y, p.x) / (2.0 * kPi) - 0.5;  // -1 to 0, in scans
    const Eigen::Vector3f seen =
        ((pose_at(i + share).inverse() * pose_at(i)).cast<float>()) * Eigen::Vector3f(p.x, p.y, p.z);
    p = {seen.x(), seen.y(), seen.z(), p.intensity};
    scan.times_s.push_back(static_cast<float>(share * kPeriod_s));
  }
  return scan;
}

double error_m(const OdometryStep& step, int i) {
  return ((pose_at(0).inverse() * pose_at(i)).translation() - step.T_odom_lidar.translation()).norm();
}

TEST(Odometry, CompensatesTheSweepItFollows) {
  Odometry odometry;
  OdometryStep step;
  for (int i = 0; i < 15; ++i) {
    step = odometry.follow(swept_scan(i));
    EXPECT_TRUE(step.is_tracked) << i;
    EXPECT_EQ(step.is_connected, i > 0);
    EXPECT_EQ(step.segment, 0);
  }
  EXPECT_LT(error_m(step, 14), 0.05) << "over 11 m";
  ASSERT_TRUE(step.motion);
  EXPECT_NEAR(step.motion->linear_mps.norm(), 0.8 / kPeriod_s, 0.5);
  // The same scan, taken at once, is what compensation must give.
  const Scan still = swept_scan(14, false);
  double worst_m = 0.0;
  for (std::size_t k = 0; k < still.points.size(); k += 50)
    worst_m = std::max(worst_m, static_cast<double>(std::hypot(still.points[k].x - step.compensated[k].x,
                                                               still.points[k].y - step.compensated[k].y)));
  EXPECT_LT(worst_m, 0.1);
}

// A sensor that is shaken about the vertical: stands still at 0, 45, 0, -45 ... degrees at the stamps.
Scan shaken_scan(int i, bool has_imu) {
  static const SyntheticWorld world(31);
  const auto yaw_at = [](double scans) { return to_radians(45.0) * std::sin(0.5 * kPi * scans); };
  Scan scan = world.scan(SyntheticWorld::at(0.0, 0.0, yaw_at(i)), {32, 600, -24.8, 5.0}, static_cast<unsigned>(i));
  scan.frame = FrameId{i};
  scan.stamp_s = kPeriod_s * i;
  for (int k = -20; has_imu && k <= 0; ++k) {
    const double at = i + 0.05 * k;  // in scans
    const auto rate = static_cast<float>((yaw_at(at) - yaw_at(at - 0.05)) / (0.05 * kPeriod_s));
    scan.imu.push_back({0.05 * kPeriod_s * k, {0.f, 0.f, rate}, {0.f, 0.f, 9.81f}});
  }
  return scan;
}

TEST(Odometry, AnImuPredictsTurnsAndKnowsUp) {
  double off_without_m = 0.0;
  for (const bool has_imu : {false, true}) {
    Odometry odometry;
    double off_m = 0.0;
    for (int i = 0; i < 12; ++i) {
      const OdometryStep step = odometry.follow(shaken_scan(i, has_imu));
      off_m = std::max(off_m, step.T_odom_lidar.translation().norm());
      if (!has_imu) {
        EXPECT_FALSE(step.up);
        continue;
      }
      EXPECT_TRUE(step.is_tracked) << i;
      ASSERT_TRUE(step.up);
      EXPECT_GT(step.up->z(), 0.999f);
      if (i == 0) continue;
      EXPECT_NEAR(std::abs(yaw_of(step.T_previous_lidar)), to_radians(45.0), 0.02) << i;
    }
    if (!has_imu) off_without_m = off_m;
    EXPECT_LT(off_m, has_imu ? 0.05 : 100.0) << "without: " << off_without_m;
  }
}

TEST(Odometry, AfterFiveScansElsewhereItIsLostAndBeginsASegment) {
  Odometry odometry;
  for (int i = 0; i < 12; ++i) odometry.follow(swept_scan(i));
  static const SyntheticWorld elsewhere(77);
  int lost_at = -1;
  for (int i = 12; i < 20; ++i) {
    Scan scan = elsewhere.scan(SyntheticWorld::at(40 + 9.0 * (i % 2), 30, 2.0 + i, 8.0), {32, 600, -24.8, 5.0});
    scan.stamp_s = kPeriod_s * i;
    const OdometryStep step = odometry.follow(std::move(scan));
    if (step.lost && lost_at < 0) lost_at = i;
    EXPECT_EQ(step.segment, lost_at >= 0 && i > lost_at ? 1 : 0) << i;
    if (i == 12) {
      EXPECT_FALSE(step.is_connected);
    }
  }
  EXPECT_EQ(lost_at, 16);
}

TEST(Odometry, StampsThatStandStillAreReplacedAndSaid) {
  Odometry odometry;
  odometry.follow(swept_scan(0, false));
  Scan scan = swept_scan(1, false);
  scan.stamp_s = 0.0;
  const OdometryStep step = odometry.follow(std::move(scan));
  EXPECT_TRUE(step.stamp_was_replaced);
  EXPECT_NEAR(step.stamp_s, 0.1, 1e-12);
}

// A corridor with few door frames: what hardly fixes a step cannot make it leap, unless the time that passed is not
// known.
std::vector<Point> corridor_from(double x_m) {
  std::vector<Point> points;
  const auto x0 = static_cast<float>(x_m);
  for (float x = -15.f; x < 15.f; x += 0.1f)
    for (float z = -1.f; z < 1.5f; z += 0.25f)
      for (const float y : {-1.5f, 1.5f}) points.push_back({x, y, z, 0.f});
  for (float x = -15.f; x < 15.f; x += 0.3f)
    for (float y = -1.4f; y < 1.5f; y += 0.2f) points.push_back({x, y, -1.f, 0.f});
  for (const float frame_m : {-9.f, -2.f, 7.f})
    for (float y = 0.9f; y < 1.5f; y += 0.05f)
      for (float z = -1.f; z < 1.5f; z += 0.1f) points.push_back({frame_m - x0, y, z, 0.f});
  return points;
}

TEST(Odometry, WhatHardlyFixesAStepCannotMakeItLeapWhereTimesAreKnown) {
  struct Stamps {
    double period_s;
    bool are_assumed;
  };
  for (const auto& [period_s, are_assumed] : {Stamps{kPeriod_s, false}, Stamps{kPeriod_s, true}, Stamps{0.0, false}}) {
    Odometry odometry;
    OdometryStep step;
    for (int i = 0; i < 9; ++i) {
      Scan scan;
      scan.points = corridor_from(i < 8 ? 0.0 : 0.5);
      scan.stamp_s = period_s * i;
      scan.is_stamp_assumed = are_assumed;
      step = odometry.follow(scan);
    }
    const bool are_known = period_s > 0.0 && !are_assumed;
    EXPECT_EQ(step.is_tracked && step.T_previous_lidar.translation().norm() > 0.3, !are_known)
        << "period " << period_s << " s: " << step.T_previous_lidar.translation().transpose();
  }
}

// Poses made from poses, scan after scan, with inverses in between: rounding must not grow.
TEST(Odometry, ALongExternalOdometryStaysARotation) {
  Odometry odometry(Odometry::Source::kExternal);
  OdometryStep step;
  constexpr int kScans = 3000;
  for (int i = 0; i < kScans; ++i) {
    Scan scan;
    scan.stamp_s = kPeriod_s * i;
    step = odometry.follow(std::move(scan), planar_pose(7, 8, 2.5) * planar_pose(0.1 * i, 0.0, 0.013 * i));
  }
  EXPECT_TRUE(step.T_odom_lidar.linear().isUnitary(1e-12));
  EXPECT_NEAR(step.T_odom_lidar.translation().x(), 0.1 * (kScans - 1), 1e-6);
  EXPECT_TRUE(step.is_connected);
}

TEST(Odometry, WithoutAPoseTheExternalOdometryIsNotConnected) {
  Odometry odometry(Odometry::Source::kExternal);
  const auto scan_at = [](double stamp_s) {
    Scan scan;
    scan.stamp_s = stamp_s;
    return scan;
  };
  EXPECT_TRUE(odometry.follow(scan_at(0.0), planar_pose(0, 0, 0)).is_tracked);
  EXPECT_FALSE(odometry.follow(scan_at(0.1)).is_tracked);
  const OdometryStep step = odometry.follow(scan_at(0.2), planar_pose(1, 0, 0));
  EXPECT_TRUE(step.is_tracked);
  EXPECT_NEAR(step.T_odom_lidar.translation().x(), 1.0, 1e-12) << "from the last scan that had a pose";
}

}  // namespace
}  // namespace revisit
