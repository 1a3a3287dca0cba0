// SPDX-License-Identifier: Apache-2.0
#include <revisit/odometry/gravity_track.hpp>

#include <cmath>
#include <functional>
#include <random>

#include <gtest/gtest.h>

namespace revisit {
namespace {

// A car on a level road, whose speed swings by 4 m/s (it brakes with up to 2.5 m/s^2) and whose heading swings, too.
Pose car_at(double t) {
  Pose T = Pose::Identity();
  T.translate(Eigen::Vector3d(10.0 * t - 6.4 * std::cos(0.63 * t), 3.0 * std::sin(0.4 * t), 0.0));
  T.rotate(Eigen::AngleAxisd(0.3 * std::sin(0.4 * t), Eigen::Vector3d::UnitZ()));
  return T;
}

Eigen::Vector3d felt_at(double t) {
  constexpr double kStep_s = 1e-3;
  const Eigen::Vector3d acceleration =
      (car_at(t + kStep_s).translation() - 2.0 * car_at(t).translation() + car_at(t - kStep_s).translation()) /
      (kStep_s * kStep_s);
  return car_at(t).linear().transpose() * (acceleration + 9.81 * Eigen::Vector3d::UnitZ());
}

// Ten scans a second, 200 readings; `T_odom_world`: odometry's frame is not level. The largest error of up.
double worst_deg(double unit, const Pose& T_odom_world, double pose_error_m) {
  GravityTrack track;
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  double worst = 0.0;
  for (int i = 0; i < 120; ++i) {
    Scan scan;
    for (int k = -19; k <= 0; ++k) {
      ImuSample sample;
      sample.time_s = 0.005 * k;
      const Eigen::Vector3d noise(normal(random), normal(random), normal(random));
      sample.acceleration_mps2 = ((felt_at(0.1 * i + sample.time_s) + 0.1 * noise) * unit).cast<float>();
      scan.imu.push_back(sample);
    }
    Pose T = T_odom_world * car_at(0.1 * i);
    T.translation() += pose_error_m * Eigen::Vector3d(normal(random), normal(random), normal(random));
    track.add(scan, 0.1 * i, T);
    EXPECT_FALSE(i < 30 && track.up()) << "after three seconds";
    if (i < 45) continue;
    if (!track.up()) return 180.0;
    worst = std::max(worst, to_degrees(std::acos(std::min(1.0, double{track.up()->z()}))));
  }
  return worst;
}

TEST(GravityTrack, BrakingAndBendsDoNotTurnUp) {
  Pose T_odom_world = Pose::Identity();
  T_odom_world.rotate(Eigen::AngleAxisd(0.2, Eigen::Vector3d(1.0, 2.0, 0.5).normalized()));
  EXPECT_LT(worst_deg(1.0, T_odom_world, 0.01), 0.15);
  EXPECT_LT(worst_deg(1.0 / 9.81, T_odom_world, 0.01), 0.15) << "in units of gravity";
}

TEST(GravityTrack, WhatIsNotAsLargeAsGravityIsNone) { EXPECT_EQ(worst_deg(1.2, Pose::Identity(), 0.01), 180.0); }

TEST(GravityTrack, BeginsAnewAfterAGap) {
  GravityTrack track;
  for (int i = 0; i < 60; ++i) {
    Scan scan;
    for (int k = -19; k <= 0; ++k)
      scan.imu.push_back({0.005 * k, Eigen::Vector3f::Zero(), Eigen::Vector3f(0.f, 0.f, 9.81f)});
    track.add(scan, 0.1 * i + (i >= 50 ? 2.0 : 0.0), Pose::Identity());
    EXPECT_TRUE((i >= 35 && i <= 42) || track.up().has_value() == (i > 42 && i < 50)) << i;
  }
}

}  // namespace
}  // namespace revisit
