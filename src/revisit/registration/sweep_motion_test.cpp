// SPDX-License-Identifier: Apache-2.0
#include <revisit/registration/sweep_motion.hpp>

#include <cmath>

#include <gtest/gtest.h>

#include <revisit/registration/surface_cloud.hpp>

#include "synthetic_world.hpp"

namespace revisit {
namespace {

using testing_support::SyntheticWorld;

const SyntheticWorld::Sensor kSensor{32, 600, -24.8, 5.0};
const Twist kMotion{{9.0, 0.3, 0.0}, {0.0, 0.0, 0.4}};

// As a sensor sees it that turns clockwise, once in 0.1 s, and moves meanwhile.
Scan swept(Scan scan) {
  for (Point& p : scan.points) {
    const double time_s = -std::atan2(static_cast<double>(p.y), static_cast<double>(p.x)) / (2.0 * kPi) * 0.1;
    const Eigen::Vector3d seen =
        motion_after(kMotion, time_s).inverse() * Eigen::Vector3f(p.x, p.y, p.z).cast<double>();
    p.x = static_cast<float>(seen.x());
    p.y = static_cast<float>(seen.y());
    p.z = static_cast<float>(seen.z());
    scan.times_s.push_back(static_cast<float>(time_s));
  }
  return scan;
}

TEST(SweepMotion, IsFoundWithThePoseFromASurface) {
  const SyntheticWorld world(61);
  const Scan place = world.scan(SyntheticWorld::at(0, 0, 0), kSensor, 1);
  const Pose T_place_query = SyntheticWorld::at(0.8, 0.4, 0.1);
  const Scan query = swept(world.scan(T_place_query, kSensor, 2));
  const SurfaceCloud surface(thin(place.points, {}, 1.0));
  const Pose T_true = SyntheticWorld::at(0, 0, 0).inverse() * T_place_query;
  for (const double off_m : {-1.5, -0.3, 1.5})
    for (const double yaw_rad : {0.05, 0.15}) {
      const auto found = find_sweep_motion(surface, query, planar_pose(0.8 + off_m, 0.4, yaw_rad), true);
      ASSERT_TRUE(found) << off_m;
      EXPECT_LT((found->motion.linear_mps - kMotion.linear_mps).norm(), 0.5) << off_m;
      EXPECT_LT((found->motion.angular_radps - kMotion.angular_radps).norm(), 0.03) << off_m;
      EXPECT_LT((T_true.inverse() * found->T_target_source).translation().norm(), 0.03) << off_m;
    }
  const Pose T_guess = planar_pose(0.5, 0.5, 0.12);
  EXPECT_FALSE(find_sweep_motion(surface, query, T_guess, false)) << "nothing moves so fast among walls";
}

TEST(SweepMotion, ASensorThatStandsDoesNotMove) {
  const SyntheticWorld world(61);
  Scan scan = world.scan(SyntheticWorld::at(0, 0, 0), kSensor, 1);
  const SurfaceCloud surface(thin(scan.points, {}, 1.0));
  EXPECT_FALSE(find_sweep_motion(surface, scan, Pose::Identity(), true)) << "without times";
  for (std::size_t i = 0; i < scan.points.size(); ++i)
    scan.times_s.push_back(static_cast<float>(i % 100) * 1e-3f - 0.05f);
  const auto found = find_sweep_motion(surface, scan, Pose::Identity(), false);
  ASSERT_TRUE(found);
  EXPECT_LT(found->motion.linear_mps.norm(), 0.3);
  Pose far = Pose::Identity();
  far.translation().z() = 500.0;
  EXPECT_FALSE(find_sweep_motion(surface, scan, far, true)) << "nothing meets it there";
}

}  // namespace
}  // namespace revisit
