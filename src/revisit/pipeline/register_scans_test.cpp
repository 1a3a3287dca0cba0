// SPDX-License-Identifier: Apache-2.0
#include <revisit/pipeline/register_scans.hpp>

#include <cmath>
#include <limits>
#include <vector>

#include <gtest/gtest.h>

#include <revisit/core/twist.hpp>

#include "synthetic_world.hpp"

namespace revisit {
namespace {

using testing_support::SyntheticWorld;

const SyntheticWorld::Sensor kDenseSensor{32, 900, -24.8, 5.0};

TEST(RegisterScans, GivesThePoseWhateverTheHeading) {
  const SyntheticWorld world(51);
  const Pose T_target = SyntheticWorld::at(4, 0, 0.4);
  for (const double heading_deg : {0.0, 100.0, 176.0, -60.0}) {
    const Pose T_source = SyntheticWorld::at(6, 1, to_radians(heading_deg));
    const auto found = register_scans(world.scan(T_source, kDenseSensor, 1), world.scan(T_target, kDenseSensor, 2));
    ASSERT_TRUE(found) << found.error().message;
    ASSERT_TRUE(found->is_accepted()) << heading_deg;
    const Pose error = (T_target.inverse() * T_source).inverse() * found->T_target_source;
    EXPECT_LT(error.translation().norm(), 0.1) << heading_deg;
    EXPECT_LT(to_degrees(rotation_angle(error)), 0.3) << heading_deg;
    EXPECT_GT(found->probability, 0.95);
    EXPECT_GT(found->information(0, 0), 0.0);
  }
}

TEST(RegisterScans, ScansOfTwoPlacesAreRefused) {
  const auto found = register_scans(SyntheticWorld(51).scan(SyntheticWorld::at(0, 0, 0), kDenseSensor),
                                    SyntheticWorld(52).scan(SyntheticWorld::at(0, 0, 0), kDenseSensor));
  ASSERT_TRUE(found);
  EXPECT_FALSE(found->is_accepted());
}

// Six tenths of what is around have changed: little fits at the right pose, and less anywhere else.
TEST(RegisterScans, APoseThatStandsOutIsBelievedThoughLittleFits) {
  const SyntheticWorld world(51), changed(151);
  const Pose T_target = SyntheticWorld::at(4, 0, 0), T_source = SyntheticWorld::at(6, 1, 1.7);
  const auto is_changed = [](const Point& p) { return std::atan2(p.y, p.x) <= 0.2 * kPi; };
  Scan source = world.scan(T_source, kDenseSensor, 1);
  std::erase_if(source.points, is_changed);
  for (const Point& p : changed.scan(T_source, kDenseSensor, 2).points)
    if (is_changed(p)) source.points.push_back(p);
  const auto found = register_scans(source, world.scan(T_target, kDenseSensor, 3));
  ASSERT_TRUE(found);
  EXPECT_LT(((T_target.inverse() * T_source).inverse() * found->T_target_source).translation().norm(), 0.05);
  EXPECT_GT(found->probability, 0.95);
}

// NaN, (0,0,0) and intensities in the thousands: what a driver delivers.
TEST(RegisterScans, TakesWhatADriverDelivers) {
  const SyntheticWorld world(51);
  const auto as_delivered = [&](const Pose& T, unsigned seed) {
    Scan scan = world.scan(T, kDenseSensor, seed);
    for (Point& p : scan.points) p.intensity *= 4000.f;
    const float nan = std::numeric_limits<float>::quiet_NaN(), infinite = std::numeric_limits<float>::infinity();
    for (int i = 0; i < 500; ++i) {
      scan.points.push_back({0.f, 0.f, 0.f, 0.f});
      scan.points.push_back({nan, nan, nan, nan});
      scan.points.push_back({infinite, 0.f, 0.f, 5.f});
      scan.points.push_back({20.f, 3.f, 1.f, nan});
    }
    return scan;
  };
  const Pose T_target = SyntheticWorld::at(4, 0, 0), T_source = SyntheticWorld::at(5, 1, 1.0);
  const auto found = register_scans(as_delivered(T_source, 1), as_delivered(T_target, 2));
  ASSERT_TRUE(found) << found.error().message;
  ASSERT_TRUE(found->is_accepted());
  const Pose error = (T_target.inverse() * T_source).inverse() * found->T_target_source;
  EXPECT_LT(error.translation().norm(), 0.1);
}

// As a sensor sees it that turns clockwise, once in 0.1 s, and moves meanwhile.
Scan swept(Scan scan, const Twist& motion) {
  for (Point& p : scan.points) {
    const double time_s = -std::atan2(static_cast<double>(p.y), static_cast<double>(p.x)) / (2.0 * kPi) * 0.1;
    const Eigen::Vector3d seen = motion_after(motion, time_s).inverse() * Eigen::Vector3f(p.x, p.y, p.z).cast<double>();
    p = {static_cast<float>(seen.x()), static_cast<float>(seen.y()), static_cast<float>(seen.z()), p.intensity};
    scan.times_s.push_back(static_cast<float>(time_s));
  }
  return scan;
}

// Two cars that pass each other: their sweeps are bent the opposite way.
TEST(RegisterScans, UndoesTheMotionDuringBothSweeps) {
  const SyntheticWorld world(51);
  const Pose T_target = SyntheticWorld::at(4, 0, 0), T_source = SyntheticWorld::at(7, 2, to_radians(175.0));
  const Scan target = swept(world.scan(T_target, kDenseSensor, 1), {{12.0, 0.0, 0.0}, {0.0, 0.0, 0.1}});
  const Scan source = swept(world.scan(T_source, kDenseSensor, 2), {{11.0, 0.0, 0.0}, {0.0, 0.0, -0.2}});
  const auto error_m = [&](const Registration& found) {
    return ((T_target.inverse() * T_source).inverse() * found.T_target_source).translation().norm();
  };
  const auto without_times = [](Scan scan) {
    scan.times_s.clear();
    return scan;
  };
  const auto found = register_scans(source, target);
  const auto half_known = register_scans(source, without_times(target));
  const auto unknown = register_scans(without_times(source), without_times(target));
  ASSERT_TRUE(found && half_known && unknown);
  EXPECT_LT(error_m(*found), 0.05);
  EXPECT_GT(found->inlier_ratio, unknown->inlier_ratio + 0.1);
  EXPECT_GT(half_known->inlier_ratio, unknown->inlier_ratio + 0.1) << "one of two sweeps";
  EXPECT_GT(found->probability, unknown->probability);
}

TEST(RegisterScans, AnEmptyScanIsAnErrorThatSaysWhy) {
  const Scan scan = SyntheticWorld(51).scan(SyntheticWorld::at(0, 0, 0), kDenseSensor);
  for (const auto& found : {register_scans(Scan{}, scan), register_scans(scan, Scan{})}) {
    ASSERT_FALSE(found);
    EXPECT_NE(found.error().message.find("are needed to describe a place"), std::string::npos);
  }
}

}  // namespace
}  // namespace revisit
