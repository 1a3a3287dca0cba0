// SPDX-License-Identifier: Apache-2.0
#include <revisit/odometry/scan_matcher.hpp>

#include <cmath>
#include <random>

#include <gtest/gtest.h>
#include <oneapi/tbb/task_arena.h>

#include "synthetic_world.hpp"

namespace revisit {
namespace {

using testing_support::SyntheticWorld;

// Along a bend, 0.6 m a scan.
Pose pose_of(int i) {
  const double s = 0.6 * i, heading = 0.02 * i;
  return SyntheticWorld::at(s, 0.2 * s * s / 20.0, heading);
}

std::vector<Point> seen_from(unsigned world, const Pose& T_world_lidar, unsigned noise) {
  static const SyntheticWorld here(31), elsewhere(77);
  return (world == 31 ? here : elsewhere).scan(T_world_lidar, {32, 600, -24.8, 5.0}, noise).points;
}

ScanMatch match(const ScanMatcher& matcher, double stamp_s, const MatcherScan& scan,
                const std::optional<MotionGuess>& guess = {}) {
  const ScanMatch there = matcher.match(stamp_s, scan, guess);
  return there.is_tracked ? there : matcher.look_around(stamp_s, scan, there);
}

ScanMatch track(ScanMatcher& matcher, double stamp_s, std::span<const Point> points,
                const std::optional<Pose>& T_previous_lidar = {}) {
  const MatcherScan scan = matcher.thinned(points);
  std::optional<MotionGuess> guess;
  if (T_previous_lidar) guess = MotionGuess{*T_previous_lidar};
  const ScanMatch found = match(matcher, stamp_s, scan, guess);
  matcher.accept(stamp_s, scan, found);
  return found;
}

TEST(ScanMatcher, FollowsABend) {
  ScanMatcher matcher;
  Pose T_found = Pose::Identity();
  for (int i = 0; i < 30; ++i) {
    const ScanMatch step = track(matcher, 0.1 * i, seen_from(31, pose_of(i), static_cast<unsigned>(i)));
    EXPECT_TRUE(step.is_tracked) << "scan " << i << ", matched " << step.icp.matched;
    T_found = step.T_odom_lidar;
  }
  const Pose error = (pose_of(0).inverse() * pose_of(29)).inverse() * T_found;
  EXPECT_LT(error.translation().norm(), 0.01 * 0.6 * 29) << "1 % of the travelled distance";
  EXPECT_LT(to_degrees(rotation_angle(error)), 0.5);
}

// Whoever limits threads by an arena need not end in it what was begun there.
TEST(ScanMatcher, WorksInOneArenaAndEndsInAnother) {
  ScanMatcher matcher;
  tbb::task_arena one_thread(1);
  for (int i = 0; i < 3; ++i)
    one_thread.execute([&] { track(matcher, 0.1 * i, seen_from(31, pose_of(i), static_cast<unsigned>(i))); });
  EXPECT_TRUE(track(matcher, 0.3, seen_from(31, pose_of(3), 3)).is_tracked);
}

// Turns and translations about an origin far away are nearly the same: they must not be solved for there.
TEST(ScanMatcher, FollowsAsWellFarFromTheOrigin) {
  ScanMatcher matcher;
  Pose T_far = planar_pose(4000.0, -3000.0, 2.0);
  Pose T_found = T_far;
  for (int i = 0; i < 15; ++i) {
    const Pose T_wheels = i == 0 ? T_far  // there the map begins
                                 : pose_of(i - 1).inverse() * pose_of(i) * planar_pose(0.1, 0.0, to_radians(2.0));
    T_found = track(matcher, 0.1 * i, seen_from(31, pose_of(i), static_cast<unsigned>(i)), T_wheels).T_odom_lidar;
  }
  const Pose error = (pose_of(0).inverse() * pose_of(14)).inverse() * (T_far.inverse() * T_found);
  EXPECT_LT(error.translation().norm(), 0.01 * 0.6 * 14);
  EXPECT_LT(to_degrees(rotation_angle(error)), 0.5);
}

TEST(ScanMatcher, SaysWhenItDoesNotMatchAndKeepsTheMotionOfTheWheels) {
  ScanMatcher matcher;
  for (int i = 0; i < 12; ++i) track(matcher, 0.1 * i, seen_from(31, pose_of(i), static_cast<unsigned>(i)));
  // Somewhere else all at once, and then nothing to be seen at all.
  const Pose T_wheels = planar_pose(0.6, 0.0, 0.02);
  const double typical = matcher.match(1.2, matcher.thinned(seen_from(31, pose_of(12), 12))).icp.matched;
  const ScanMatch lost = track(matcher, 1.2, seen_from(77, SyntheticWorld::at(40, 30, 2.0), 1), T_wheels);
  const ScanMatch blind = track(matcher, 1.3, {}, T_wheels);
  for (const ScanMatch& step : {lost, blind}) {
    EXPECT_FALSE(step.is_tracked) << step.icp.matched << " of " << typical;
    EXPECT_TRUE(step.T_previous_lidar.isApprox(T_wheels));
  }
}

// Something before the sensor, and it turns meanwhile: the heading is found again, and what came after is predicted by
// the motion, not by the step that made up for the predictions.
TEST(ScanMatcher, AfterAWideTurnUnseenItIsFoundAgain) {
  ScanMatcher matcher;
  const auto turned = [](int i, double deg) { return pose_of(i) * planar_pose(0.0, 0.0, to_radians(deg)); };
  for (int i = 0; i < 12; ++i) track(matcher, 0.1 * i, seen_from(31, pose_of(i), static_cast<unsigned>(i)));
  for (int i = 12; i < 15; ++i) track(matcher, 0.1 * i, {});
  const ScanMatch found = track(matcher, 1.5, seen_from(31, turned(15, 75.0), 15));
  ASSERT_TRUE(found.is_tracked) << found.icp.matched;
  const Pose error = (pose_of(0).inverse() * turned(15, 75.0)).inverse() * found.T_odom_lidar;
  EXPECT_LT(error.translation().norm(), 0.2);
  EXPECT_LT(to_degrees(rotation_angle(error)), 1.0);
  const auto motion = matcher.predicted_motion(1.6);
  ASSERT_TRUE(motion);
  EXPECT_NEAR(to_degrees(motion->angular_radps.z()), 75.0 / 0.4, 30.0) << "a second: since the last scan that was seen";
}

// A bare corridor without an end: every scan looks like the one before, wherever the robot is.
std::vector<Point> corridor(unsigned noise) {
  std::mt19937 random(noise);
  std::normal_distribution<float> off(0.f, 0.01f);
  std::vector<Point> points;
  for (float x = -30.f; x < 30.f; x += 0.1f) {
    for (float z = -1.f; z < 2.f; z += 0.2f)
      for (const float y : {-2.f, 2.f}) points.push_back({x, y + off(random), z, 0.f});
    for (float y = -2.f; y < 2.f; y += 0.2f) points.push_back({x, y, -1.f + off(random), 0.f});
  }
  return points;
}

TEST(ScanMatcher, WhatScansDoNotFixIsTakenFromWheels) {
  ScanMatcher matcher;
  const Pose T_wheels = planar_pose(0.5, 0.0, 0.0);
  Pose T_found = Pose::Identity();
  for (int i = 0; i < 40; ++i) {
    const ScanMatch step = track(matcher, 0.1 * i, corridor(static_cast<unsigned>(i)),
                                 i == 0 ? std::nullopt : std::optional<Pose>(T_wheels));
    EXPECT_TRUE(step.is_tracked);
    T_found = step.T_odom_lidar;
  }
  EXPECT_NEAR(T_found.translation().x(), 19.5, 0.4) << "2 % of the travelled distance";
  EXPECT_LT(std::abs(T_found.translation().y()), 0.1);
}

// The ground fits wherever a car went: a scan that shows it alone says nothing, and is not tracked.
TEST(ScanMatcher, TheGroundAloneIsNoMatch) {
  ScanMatcher matcher;
  for (int i = 0; i < 8; ++i) track(matcher, 0.1 * i, seen_from(31, pose_of(i), static_cast<unsigned>(i)));
  std::vector<Point> points = seen_from(31, pose_of(8), 8);
  const std::size_t all = points.size();
  std::erase_if(points, [](const Point& p) { return p.z > -1.6f; });
  ASSERT_GT(points.size(), all / 2) << "most of it is ground";
  const ScanMatch step = match(matcher, 0.8, matcher.thinned(points));
  EXPECT_GT(step.icp.matched, 0.5);
  EXPECT_FALSE(step.is_tracked);
}

// Onto a meadow: of what stands upright ever less is seen, and grass is where it is by chance. Wheels tell the way.
TEST(ScanMatcher, GoesAsWheelsTellOverAMeadow) {
  ScanMatcher matcher;
  std::mt19937 random(9);
  std::normal_distribution<float> grass(0.f, 0.08f);
  double squares = 0.0;
  for (int i = 0; i < 50; ++i) {
    std::vector<Point> points = seen_from(31, SyntheticWorld::at(0.12 * i, 0.0, 0.0), static_cast<unsigned>(i));
    const int every = 1 << i / 2;
    int upright = 0;
    std::erase_if(points, [&](const Point& p) { return p.z > -1.5f && ++upright % every != 0; });
    for (Point& p : points) p.z += p.z < -1.5f ? grass(random) : 0.f;
    const ScanMatch step = track(matcher, 0.1 * i, points, planar_pose(0.12, 0.0, 0.0));
    if (i > 20)
      squares += (step.T_previous_lidar.translation() - Eigen::Vector3d(0.12, 0.0, 0.0)).head<2>().squaredNorm();
  }
  EXPECT_LT(std::sqrt(squares / 29), 0.03) << "of 0.12 m";
}

// A round hall with thin pillars, seen by a sensor that has turned by `yaw_rad`: scans hardly tell by how much.
std::vector<Point> seen_in_a_round_hall(double yaw_rad, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0.0, 0.01);
  std::uniform_real_distribution<double> any(-kPi, kPi), height(-1.5, 1.5);
  std::vector<Point> points;
  const auto add = [&](double range_m, double angle_rad, double z_m) {
    const double r = range_m + noise(random);
    points.push_back({static_cast<float>(r * std::cos(angle_rad)), static_cast<float>(r * std::sin(angle_rad)),
                      static_cast<float>(z_m), 0.f});
  };
  for (int k = 0; k < 1500; ++k) add(8.0, any(random), height(random));
  for (int k = 0; k < 1500; ++k) add(8.0 * std::sqrt(std::abs(any(random)) / kPi), any(random), -1.5);
  for (int k = 0; k < 1200; ++k) add(6.0 + 0.1 * (k % 7), 0.5 * (k % 12) + 0.02 * (k % 5) - yaw_rad, height(random));
  return points;
}

struct HeadingErrors {
  double in_the_street_deg = 0.0, in_the_hall_deg = 0.0;  ///< root mean squares, of the steps
};

// Turns to and fro in a street, then in a hall, with an IMU that says `imu_says` times the turn.
HeadingErrors heading_errors(double imu_says) {
  constexpr int kInTheStreet = 36, kScans = 46;
  static const SyntheticWorld street(31);
  ScanMatcher matcher;
  double yaw_rad = 0.0;
  HeadingErrors squares;
  for (int i = 0; i < kScans; ++i) {
    const double turn_rad = to_radians(i / 9 % 2 == 0 ? 3.0 : -3.0);
    yaw_rad += turn_rad;
    if (i == kInTheStreet) matcher.restart();
    const auto seed = static_cast<unsigned>(i);
    const MatcherScan scan = matcher.thinned(
        i < kInTheStreet ? street.scan(SyntheticWorld::at(0.0, 0.0, yaw_rad), {16, 300, -24.8, 5.0}, seed).points
                         : seen_in_a_round_hall(yaw_rad, seed));
    const ScanMatch step = match(matcher, 0.1 * i, scan,
                                 MotionGuess{planar_pose(0.0, 0.0, imu_says * turn_rad), MotionGuess::Measured::kTurn});
    matcher.accept(0.1 * i, scan, step);
    if (i == 0 || i == kInTheStreet) continue;
    double& sum = i < kInTheStreet ? squares.in_the_street_deg : squares.in_the_hall_deg;
    sum += std::pow(to_degrees(yaw_of(step.T_previous_lidar) - turn_rad), 2);
  }
  return {std::sqrt(squares.in_the_street_deg / (kInTheStreet - 1)),
          std::sqrt(squares.in_the_hall_deg / (kScans - kInTheStreet - 1))};
}

TEST(ScanMatcher, TurnsAsAnImuTellsThatWasRightSoFar) {
  const HeadingErrors right = heading_errors(1.0);
  EXPECT_LT(right.in_the_street_deg, 0.2);
  EXPECT_LT(right.in_the_hall_deg, 0.6);
  EXPECT_LT(heading_errors(-1.0).in_the_street_deg, 0.2) << "its axes are not the sensor's, and it is not believed";
}

// Twice a second at 12 m/s, from the first scan on, then a turn that the motion before does not tell.
TEST(ScanMatcher, FollowsACarTwiceASecond) {
  ScanMatcher matcher;
  const SyntheticWorld world(31, 45.0, 150);
  Pose T_world_lidar = SyntheticWorld::at(-30.0, 0.0, 0.0);
  const Pose T_world_odom = T_world_lidar;
  for (int i = 0; i < 9; ++i) {
    const ScanMatch step = track(matcher, 0.5 * i, world.scan(T_world_lidar, {64, 600, -24.8, 5.0}, 1).points);
    EXPECT_TRUE(step.is_tracked) << "scan " << i;
    const Pose error = (T_world_odom.inverse() * T_world_lidar).inverse() * step.T_odom_lidar;
    EXPECT_LT(error.translation().norm(), 0.3) << "scan " << i;
    T_world_lidar = T_world_lidar * planar_pose(6.0, 0.0, to_radians(i < 2 ? 0.0 : i % 2 == 0 ? 20.0 : -20.0));
  }
}

// 70 degrees wide, it turns by 12 degrees a scan: soon nothing of what it sees was in its first view.
TEST(ScanMatcher, FollowsANarrowSensorThatTurns) {
  ScanMatcher matcher;
  const auto pose = [](int i) { return SyntheticWorld::at(0.02 * i, 0.0, to_radians(i < 8 ? 0.0 : 12.0 * (i - 8))); };
  Pose T_found = Pose::Identity();
  for (int i = 0; i < 24; ++i) {
    std::vector<Point> points = seen_from(31, pose(i), static_cast<unsigned>(i));
    std::erase_if(points, [](const Point& p) { return std::atan2(std::abs(p.y), p.x) > to_radians(35.0); });
    const ScanMatch step = track(matcher, 0.1 * i, points);
    EXPECT_TRUE(step.is_tracked) << "scan " << i << ", matched " << step.icp.matched << " of " << step.icp.met;
    T_found = step.T_odom_lidar;
  }
  const Pose error = (pose(0).inverse() * pose(23)).inverse() * T_found;
  EXPECT_LT(error.translation().norm(), 0.2);
  EXPECT_LT(to_degrees(rotation_angle(error)), 1.0);
}

// Of 16 lines most lie on the ground, where they match as well if the sensor stands: few things around say that it
// drives.
TEST(ScanMatcher, AStartInMotionAmongFewThingsIsNoStandstill) {
  constexpr double kStep_m = 1.2;
  constexpr int kScans = 8;
  for (const unsigned seed : {10u, 33u, 55u}) {
    const SyntheticWorld world(seed, 60.0, 10);
    ScanMatcher matcher;
    matcher.set_rings(16);
    ScanMatch step;
    for (int i = 0; i < kScans; ++i) {
      const Scan scan =
          world.scan(SyntheticWorld::at(kStep_m * i, 0, 0), {16, 900, -15.0, 15.0}, static_cast<unsigned>(i) + 1);
      step = track(matcher, 0.1 * i, scan.points);
    }
    EXPECT_NEAR(step.T_odom_lidar.translation().x(), kStep_m * (kScans - 1), 0.3) << "world " << seed;
  }
}

TEST(ScanMatcher, AStandingStartAndTimesThatStandStill) {
  ScanMatcher matcher;
  for (const double stamp_s : {5.0, 5.0, 4.0, 4.5}) {
    const ScanMatch step = track(matcher, stamp_s, seen_from(31, pose_of(0), 3));
    EXPECT_TRUE(step.is_tracked);
    EXPECT_LT(step.T_odom_lidar.translation().norm(), 0.01);
  }
  EXPECT_FALSE(matcher.predicted_motion(4.5)) << "no time has passed";
  EXPECT_FALSE(matcher.predicted_motion(60.0)) << "too long a gap to predict anything";
  EXPECT_TRUE(matcher.predicted_motion(4.6));
}

}  // namespace
}  // namespace revisit
