// SPDX-License-Identifier: Apache-2.0
#include <revisit/odometry/velocity_filter.hpp>

#include <cmath>
#include <random>

#include <gtest/gtest.h>

namespace revisit {
namespace {

const Eigen::Matrix3d kSure = 1e6 * Eigen::Matrix3d::Identity(), kNothing = Eigen::Matrix3d::Zero();

VelocityFilter at_one_mps() {
  VelocityFilter filter;
  for (int i = 0; i < 20; ++i) filter.advance(0.1, planar_pose(0.1, 0.0, 0.0), kSure);
  return filter;
}

double stddev_m(const VelocityFilter& filter, int axis, double time_s = 0.1) {
  return std::sqrt(filter.covariance_after(time_s, Eigen::Matrix3d::Identity())(axis, axis));
}

TEST(VelocityFilter, IsThatOfTheLastStepWhereScansFixIt) {
  VelocityFilter filter;
  EXPECT_GT(stddev_m(filter, 0), 1.0) << "nothing is known";
  filter.advance(0.1, planar_pose(0.1, 0.0, 0.0), kSure);
  EXPECT_NEAR(filter.velocity_mps().x(), 1.0, 0.01);
  filter.advance(0.1, planar_pose(0.2, 0.05, 0.0), kSure);
  EXPECT_NEAR(filter.velocity_mps().x(), 2.0, 0.02);
  EXPECT_NEAR(filter.velocity_mps().y(), 0.5, 0.02);
  // Two metres a second off after a second, by the root of the time: 0.63 after a scan.
  EXPECT_NEAR(stddev_m(filter, 0), 0.063, 0.003);
  EXPECT_NEAR(stddev_m(filter, 0, 0.4), 0.4 * 2.0 * std::sqrt(0.4), 0.01);
}

TEST(VelocityFilter, GoesOnAlongWhatScansDoNotFix) {
  VelocityFilter filter = at_one_mps();
  const Eigen::Matrix3d sideways = Eigen::Vector3d(0.0, 1e6, 1e6).asDiagonal();
  for (int i = 0; i < 10; ++i) filter.advance(0.1, planar_pose(0.1, 0.0, 0.0), sideways);
  EXPECT_NEAR(filter.velocity_mps().x(), 1.0, 0.01);
  EXPECT_GT(stddev_m(filter, 0), 0.5);
  EXPECT_LT(stddev_m(filter, 1), 0.1);
}

TEST(VelocityFilter, ManyUncertainStepsTellMoreThanTheLast) {
  std::mt19937 random(5);
  std::normal_distribution<double> noise(0.0, 0.1);
  VelocityFilter filter = at_one_mps();
  double last_m = 0.0, squares = 0.0, of_steps = 0.0;
  for (int i = 0; i < 200; ++i) {
    const double off_m = noise(random), step_m = 0.1 + off_m - last_m;
    last_m = off_m;
    filter.advance(0.1, planar_pose(step_m, 0.0, 0.0), 100.0 * Eigen::Matrix3d::Identity());
    squares += std::pow(filter.velocity_mps().x() - 1.0, 2);
    of_steps += std::pow(step_m / 0.1 - 1.0, 2);
  }
  EXPECT_LT(squares, 0.5 * of_steps);
}

// A second along which nothing fixed it, then a scan that finds it 0.2 m farther on: it was faster by as much.
TEST(VelocityFilter, WhatIsFoundLateMakesUpForAllTheTime) {
  VelocityFilter filter = at_one_mps();
  for (int i = 0; i < 10; ++i) filter.advance(0.1, planar_pose(0.1, 0.0, 0.0), kNothing);
  filter.advance(0.1, planar_pose(0.3, 0.0, 0.0), kSure);
  EXPECT_GT(filter.velocity_mps().x(), 1.1);
  EXPECT_LT(filter.velocity_mps().x(), 1.5) << "not three metres a second, as the last step alone has it";
}

TEST(VelocityFilter, TurnsWithTheSensor) {
  VelocityFilter filter = at_one_mps();
  const Pose quarter = planar_pose(0.1, 0.0, kPi / 2);
  // What was free along x before the turn is free along y after it.
  filter.advance(0.1, quarter, Eigen::Vector3d(1e6, 0.0, 1e6).asDiagonal());
  for (int i = 0; i < 9; ++i)
    filter.advance(0.1, planar_pose(0.1, 0.0, 0.0), Eigen::Vector3d(1e6, 0.0, 1e6).asDiagonal());
  const Eigen::Matrix3d after = filter.covariance_after(0.1, Eigen::Matrix3d::Identity());
  const Eigen::Matrix3d turned = filter.covariance_after(0.1, quarter.linear());
  EXPECT_GT(after(1, 1), 10.0 * after(0, 0));
  EXPECT_NEAR(turned(0, 0), after(1, 1), 1e-9);
}

TEST(VelocityFilter, StaysSoundThroughALongDrive) {
  VelocityFilter filter;
  std::mt19937 random(3);
  std::uniform_real_distribution<double> exponent(-3.0, 7.0);
  for (int i = 0; i < 20000; ++i) {
    const Eigen::Vector3d fixes(std::pow(10.0, exponent(random)), std::pow(10.0, exponent(random)),
                                i % 7 == 0 ? 0.0 : std::pow(10.0, exponent(random)));
    filter.advance(i % 50 == 0 ? 1.5 : 0.1, planar_pose(0.1, 0.01, 0.05), fixes.asDiagonal());
    const Eigen::Matrix3d covariance = filter.covariance_after(0.1, Eigen::Matrix3d::Identity());
    ASSERT_TRUE(covariance.allFinite()) << i;
    ASSERT_GT(covariance.diagonal().minCoeff(), 0.0) << i;
    ASSERT_LT((covariance - covariance.transpose()).norm(), 1e-6 * covariance.norm()) << i;
  }
  EXPECT_NEAR(filter.velocity_mps().x(), 1.0, 0.1);
}

}  // namespace
}  // namespace revisit
