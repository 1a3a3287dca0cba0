// SPDX-License-Identifier: Apache-2.0
#include <revisit/registration/icp.hpp>

#include <tuple>
#include <vector>

#include <gtest/gtest.h>

#include <revisit/registration/agreement.hpp>
#include <revisit/registration/surface_cloud.hpp>

#include "oracles/pcl_icp.hpp"
#include "thin_scan.hpp"

namespace revisit {
namespace {

using testing_support::error_deg;
using testing_support::error_m;
using testing_support::SyntheticWorld;
using testing_support::thin_scan;

TEST(Icp, FindsAKnownMotionFromMetresAway) {
  const Pose T_a = SyntheticWorld::at(0, 0, 0), T_b = SyntheticWorld::at(2.5, 0.8, to_radians(8.0));
  const SurfaceCloud a(thin_scan(T_a)), b(thin_scan(T_b, 2));
  const Pose T_truth = T_a.inverse() * T_b;
  const IcpResult result = align_icp(a, b.points(), Pose::Identity());
  EXPECT_TRUE(result.converged);
  EXPECT_LT(error_m(result.T_target_source, T_truth), 0.05);
  EXPECT_LT(error_deg(result.T_target_source, T_truth), 0.2);
  EXPECT_GT(measure_agreement(a, b, result.T_target_source, 0.4).inlier_ratio, 0.7);
}

// Where nothing but ground is seen, position and heading are what was known before; where walls are, they tell.
TEST(Icp, APriorTellsWhatSurfacesDoNot) {
  const auto seen = [](const SyntheticWorld& world, const Pose& T_world_lidar, unsigned seed) {
    const Scan scan = world.scan(T_world_lidar, {32, 900, -24.8, 5.0}, seed);
    return SurfaceCloud(thin(scan.points, std::vector<std::uint8_t>(scan.points.size(), 0), 1.0));
  };
  const SyntheticWorld plain(31, 60.0, 0), town(31);
  const Pose T = SyntheticWorld::at(0, 0, 0), T_true = planar_pose(0.2, 0.1, 0.0);
  IcpOptions options{.coarse_m = 1.0, .least_seen = 1e-3};
  options.prior = PosePrior{planar_pose(0.5, -0.3, to_radians(3.0)), 100.0 * Eigen::Matrix3d::Identity(),
                            1e4 * Eigen::Matrix3d::Identity()};
  const SurfaceCloud ground = seen(plain, T, 1), same_ground = seen(plain, T * T_true, 2);
  const IcpResult on_ground = align_icp(ground, same_ground.points(), Pose::Identity(), options);
  EXPECT_NEAR(on_ground.T_target_source.translation().x(), 0.5, 0.05);
  EXPECT_NEAR(on_ground.T_target_source.translation().y(), -0.3, 0.05);
  EXPECT_NEAR(on_ground.T_target_source.translation().z(), 0.0, 0.02) << "the ground tells the height";
  EXPECT_NEAR(to_degrees(yaw_of(on_ground.T_target_source)), 3.0, 0.3);
  const SurfaceCloud walls = seen(town, T, 1), same_walls = seen(town, T * T_true, 2);
  const IcpResult in_town = align_icp(walls, same_walls.points(), Pose::Identity(), options);
  EXPECT_LT(error_m(in_town.T_target_source, T_true), 0.05);
  EXPECT_LT(error_deg(in_town.T_target_source, T_true), 0.2);
  EXPECT_GT(in_town.position_information(0, 0), 5.0 * on_ground.position_information(0, 0));
  EXPECT_GT(in_town.position_information(2, 2), 3e3) << "most surfaces are ground: to two centimetres";
}

TEST(Icp, AgreesWithPclFromNearby) {
  const Pose T_a = SyntheticWorld::at(0, 0, 0), T_b = SyntheticWorld::at(0.3, 0.1, to_radians(1.0));
  const SurfaceCloud a(thin_scan(T_a)), b(thin_scan(T_b, 2));
  const Pose T_oracle = oracles::pcl_point_to_plane(a, b, Pose::Identity(), 0.5, 50);
  const Pose T = align_icp(a, b.points(), Pose::Identity(), {.coarse_m = 1.0}).T_target_source;
  EXPECT_LT(error_m(T, T_oracle), 0.05);
  EXPECT_LT(error_deg(T, T_oracle), 0.2);
}

TEST(Icp, PlaneToPlaneAgreesWithPclsGeneralisedIcp) {
  const Pose T_a = SyntheticWorld::at(0, 0, 0), T_b = SyntheticWorld::at(0.3, 0.1, to_radians(1.0));
  const SurfaceCloud a(thin_scan(T_a)), b(thin_scan(T_b, 2));
  const Pose T_oracle = oracles::pcl_generalised_icp(a, b, 1.0), T_truth = T_a.inverse() * T_b;
  const Pose T =
      align_icp(a, b.points(), Pose::Identity(), {.coarse_m = 1.0, .source_normals = b.normals()}).T_target_source;
  EXPECT_LT(error_m(T, T_oracle), 0.05);
  EXPECT_LT(error_deg(T, T_oracle), 0.2);
  EXPECT_LT(error_m(T, T_truth), 0.05);
}

TEST(Icp, InformationIsSmallAlongACorridor) {
  std::vector<Point> corridor, room;
  for (float x = -20.f; x <= 20.f; x += 0.25f)
    for (float z = 0.f; z <= 3.f; z += 0.25f)
      for (const float y : {-2.f, 2.f}) corridor.push_back({x, y, z, 0.f});
  for (float x = -20.f; x <= 20.f; x += 0.25f)
    for (float y = -2.f; y <= 2.f; y += 0.25f) corridor.push_back({x, y, 0.f, 0.f});
  room = corridor;
  for (float y = -2.f; y <= 2.f; y += 0.25f)
    for (float z = 0.f; z <= 3.f; z += 0.25f) room.push_back({15.f, y, z, 0.f});
  const auto information = [](const std::vector<Point>& points, const Pose& T) {
    const SurfaceCloud cloud(thin(points, {}, 0.5));
    std::vector<Eigen::Vector3f> seen;  // by a sensor that stands elsewhere and looks another way
    for (const auto& p : cloud.points()) seen.push_back((T.inverse() * p.cast<double>()).cast<float>());
    return align_icp(cloud, seen, T).information;
  };
  const Matrix6 open = information(corridor, Pose::Identity()), closed = information(room, Pose::Identity());
  EXPECT_LT(open(0, 0), 0.05 * open(1, 1)) << "nothing fixes the way along x";
  EXPECT_GT(closed(0, 0), 5.0 * open(0, 0)) << "the wall ahead does";
  // Seen by a sensor turned to the left, the corridor runs along its y.
  const Matrix6 turned = information(corridor, planar_pose(3, 0, kPi / 2));
  EXPECT_LT(turned(1, 1), 0.05 * turned(0, 0));
}

TEST(Icp, GivesUpEarlyWhereTooLittleMatches) {
  const SurfaceCloud a(thin_scan(SyntheticWorld::at(0, 0, 0)));
  const Scan scan = SyntheticWorld(32).scan(SyntheticWorld::at(0, 0, 0), {32, 900, -24.8, 5.0});
  const SurfaceCloud elsewhere(thin(scan.points, {}, 1.0));
  const IcpResult patient = align_icp(a, elsewhere.points(), Pose::Identity());
  ASSERT_LT(patient.matched, 0.6);
  const IcpResult result = align_icp(a, elsewhere.points(), Pose::Identity(), {.least_matched = 0.8});
  EXPECT_FALSE(result.converged);
  EXPECT_LT(result.iterations, patient.iterations);
  const SurfaceCloud here(thin_scan(SyntheticWorld::at(0.5, 0, 0), 2));
  EXPECT_TRUE(align_icp(a, here.points(), Pose::Identity(), {.least_matched = 0.3}).converged);
}

// Some of the points lead near the optimum; where it is, all of them decide.
TEST(Icp, SomePointsLeadToWhereAllSettle) {
  const Pose T_a = SyntheticWorld::at(0, 0, 0), T_b = SyntheticWorld::at(0.3, 0.1, to_radians(1.0));
  const SurfaceCloud a(thin_scan(T_a)), b(thin_scan(T_b, 2));
  constexpr std::size_t kSome = 400;
  std::vector<Eigen::Vector3f> few;
  for (std::size_t i = 0; i < b.points().size(); i += b.points().size() / kSome) few.push_back(b.points()[i]);
  const IcpResult with_all = align_icp(a, b.points(), Pose::Identity(), {.coarse_m = 1.0}),
                  with_some = align_icp(a, b.points(), Pose::Identity(), {.coarse_m = 1.0, .settles_with = kSome}),
                  with_few = align_icp(a, few, Pose::Identity(), {.coarse_m = 1.0});
  EXPECT_TRUE(with_some.converged);
  EXPECT_LT(error_m(with_some.T_target_source, with_all.T_target_source), 1e-3);
  EXPECT_LT(error_deg(with_some.T_target_source, with_all.T_target_source), 0.01);
  EXPECT_NEAR(with_some.matched, with_all.matched, 1e-3);
  EXPECT_GT(error_m(with_few.T_target_source, with_all.T_target_source), 5e-3) << "they alone settle elsewhere";
}

TEST(Icp, OfAScanWithItselfIsTheIdentity) {
  const SurfaceCloud a(thin_scan(SyntheticWorld::at(0, 0, 0)));
  const IcpResult result = align_icp(a, a.points(), Pose::Identity());
  EXPECT_TRUE(result.converged);
  EXPECT_LT(error_m(result.T_target_source, Pose::Identity()), 1e-6);
  const Agreement agreement = measure_agreement(a, a, Pose::Identity(), 0.4);
  EXPECT_DOUBLE_EQ(agreement.inlier_ratio, 1.0);
  EXPECT_NEAR(agreement.rmse_m, 0.0, 1e-9);
}

// A level floor on one side, on the other something vague that leans by two degrees.
class FloorAndHedge final : public Surface {
 public:
  bool nearest_patch(const Eigen::Vector3f& query, float, Patch& patch) const override {
    patch = {.point = {query.x(), query.y(), 0.f}, .normal = Eigen::Vector3f::UnitZ()};
    if (query.y() < 0.f) return true;
    constexpr float kSlope = 0.035f;
    patch.point.z() = kSlope * query.x();
    patch.normal = Eigen::Vector3f(-kSlope, 0.f, 1.f).normalized();
    patch.variance_m2 = 0.04f;
    return true;
  }
};

TEST(Icp, WhatIsUncertainCountsForLess) {
  std::vector<Eigen::Vector3f> level;
  for (int i = 0; i < 400; ++i)
    level.emplace_back(static_cast<float>(i % 20 - 10), static_cast<float>(i / 20) - 9.5f, 0.f);
  const auto tilt_deg = [&](double noise_m) {
    const IcpResult result =
        align_icp(FloorAndHedge(), level, Pose::Identity(), {.coarse_m = 1.0, .least_seen = 0.01, .noise_m = noise_m});
    EXPECT_TRUE(result.converged);
    return to_degrees(rotation_angle(result.T_target_source));
  };
  EXPECT_GT(tilt_deg(0.0), 0.7);
  EXPECT_LT(tilt_deg(0.03), 0.2);
}

// Level ground whose patches lean to and fro, and a wall across at 20 m.
class RippledGroundAndWall final : public Surface {
 public:
  explicit RippledGroundAndWall(float lean) : lean_(lean) {}
  bool nearest_patch(const Eigen::Vector3f& query, float, Patch& patch) const override {
    if (query.x() > 10.f) {
      patch = {.point = {20.f, query.y(), query.z()}, .normal = Eigen::Vector3f::UnitX()};
      return true;
    }
    const float cell = std::round(query.x());
    const float lean = static_cast<int>(cell) % 2 == 0 ? lean_ : -lean_;
    patch = {.point = {cell, query.y(), 0.f}, .normal = Eigen::Vector3f(lean, 0.f, 1.f).normalized()};
    return true;
  }

 private:
  float lean_;
};

TEST(Icp, RingsOnTheGroundDoNotHoldTheSensorBack) {
  std::vector<Eigen::Vector3f> points;
  for (int i = 0; i < 4000; ++i)
    points.emplace_back(static_cast<float>(i % 20 - 10), 0.05f * static_cast<float>(i / 20) - 5.f, 0.f);
  for (int i = 0; i < 40; ++i) points.emplace_back(19.7f, 0.5f * static_cast<float>(i) - 10.f, 1.f);  // 0.3 m before it
  const auto align = [&](float lean, double level_deg) {
    return align_icp(RippledGroundAndWall(lean), points, Pose::Identity(),
                     {.coarse_m = 1.0, .least_seen = 1e-3, .level_deg = level_deg});
  };
  // Ground that leans by 6 degrees, and crowns by 17: their points lie farther from the planes, and match less.
  for (const auto& [lean, level_deg, least_matched] : {std::tuple(0.1f, 8.0, 0.9), {0.3f, 20.0, 0.75}}) {
    EXPECT_LT(align(lean, 0.0).T_target_source.translation().x(), 0.25) << "the ripples hold it back: " << lean;
    const IcpResult found = align(lean, level_deg);
    EXPECT_NEAR(found.T_target_source.translation().x(), 0.3, 0.01) << lean;
    EXPECT_GT(found.matched, least_matched);
    EXPECT_NEAR(found.matched_sideways, 0.01, 0.005) << "the wall's share";
  }
}

TEST(Icp, TooLittleToAlignDoesNotConverge) {
  const SurfaceCloud a(thin_scan(SyntheticWorld::at(0, 0, 0)));
  const SurfaceCloud nothing(ThinCloud{}), one(thin(std::vector<Point>{{1, 2, 3, 0}}, {}, 1.0));
  for (const SurfaceCloud* each : {&nothing, &one}) {
    EXPECT_FALSE(align_icp(a, each->points(), Pose::Identity()).converged);
    EXPECT_FALSE(align_icp(*each, a.points(), Pose::Identity()).converged);
    EXPECT_EQ(measure_agreement(a, *each, Pose::Identity(), 0.4).inlier_ratio, 0.0);
  }
}

}  // namespace
}  // namespace revisit
