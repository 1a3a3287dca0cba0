// SPDX-License-Identifier: Apache-2.0
#include <revisit/verification/geometric.hpp>

#include <cmath>

#include <gtest/gtest.h>

#include <revisit/registration/agreement.hpp>
#include <revisit/verification/acceptance.hpp>

#include "synthetic_world.hpp"

namespace revisit {
namespace {

using testing_support::SyntheticWorld;

ScanGeometry scan_at(unsigned world, const Pose& T_world_lidar) {
  const Scan scan = SyntheticWorld(world).scan(T_world_lidar, {32, 900, -24.8, 5.0});
  std::vector<std::uint8_t> ground;
  for (const Point& p : scan.points) ground.push_back(p.z < -1.6f);
  return ScanGeometry(thin(scan.points, ground, 1.0));
}

TEST(GeometricConsistency, ARevisitGivesItsPose) {
  const Pose T_match = SyntheticWorld::at(0, 0, 0), T_query = SyntheticWorld::at(2, 1, to_radians(175.0));
  ScanGeometry match = scan_at(31, T_match), query = scan_at(31, T_query);
  const GeometricEvidence evidence = check_geometric(match, query, {planar_pose(0, 0, to_radians(180.0))}, {});
  ASSERT_TRUE(evidence.is_consistent()) << evidence.refusal->value;
  const Pose error = (T_match.inverse() * T_query).inverse() * evidence.T_match_query;
  EXPECT_LT(error.translation().norm(), 0.1);
  EXPECT_LT(to_degrees(rotation_angle(error)), 0.3);
  EXPECT_FALSE(evidence.from_features) << "the descriptor's yaw was good enough";
}

TEST(GeometricConsistency, InliersCountAsAShareOfTheTypicalOnes) {
  ScanGeometry match = scan_at(31, SyntheticWorld::at(0, 0, 0)), query = scan_at(31, SyntheticWorld::at(2, 1, 0.0));
  const auto in = [&](double typical) {
    return check_geometric(match, query, {planar_pose(0, 0, 0.0), 0.8, {.in_sight_ratio = typical}}, {});
  };
  const GeometricEvidence field = in(0.85), shelves = in(1.0);
  EXPECT_DOUBLE_EQ(field.evidence.inlier_ratio, shelves.evidence.inlier_ratio);
  EXPECT_NEAR(field.evidence.inlier_share, shelves.evidence.inlier_share / 0.85, 1e-9);
  EXPECT_GT(shelves.evidence.inlier_share, shelves.evidence.inlier_ratio) << "what is hidden does not count";
  EXPECT_GT(field.log_odds, shelves.log_odds + 1.0);
}

TEST(GeometricConsistency, IntensitiesCountAsAShareOfTheTypicalOnes) {
  const ScanGeometry match = scan_at(31, SyntheticWorld::at(0, 0, 0)), query = scan_at(31, SyntheticWorld::at(2, 1, 0));
  const auto agreement = [&](double typical) {
    return check_geometric(match, query, {planar_pose(2, 1, 0), 0.8, {.intensity_correlation = typical}}, {})
        .evidence.intensity_agreement.value();
  };
  EXPECT_NEAR(agreement(0.5), 2.0 * agreement(1.0), 1e-9);
}

// One sensor looks farther down than the other, or sees a sector alone.
TEST(GeometricConsistency, KnowsWhatTwoSensorsSeeOfAPlace) {
  const Pose T_match = SyntheticWorld::at(0, 0, 0), T_query = SyntheticWorld::at(2, 1, 0.1);
  const auto seen = [](const Pose& T, double lowest_deg, double highest_deg, double half_width_deg) {
    Scan scan = SyntheticWorld(31).scan(T, {32, 900, lowest_deg, highest_deg});
    std::erase_if(scan.points,
                  [&](const Point& p) { return std::abs(std::atan2(p.y, p.x)) > to_radians(half_width_deg); });
    return ScanGeometry(thin(scan.points, {}, 1.0));
  };
  const auto evidence = [&](const ScanGeometry& match, const ScanGeometry& query) {
    return check_geometric(match, query, {T_match.inverse() * T_query}, {});
  };
  const auto in_sight = [](const ScanGeometry& match, const ScanGeometry& query, const GeometricEvidence& found) {
    return measure_agreement(match.surface(), query.surface(), found.T_match_query,
                             PairScale(match.surface(), query.surface()).inlier_distance_m())
        .in_sight_ratio;
  };
  const ScanGeometry match = seen(T_match, -24.8, 5.0, 180.0), same = seen(T_query, -24.8, 5.0, 180.0);
  const ScanGeometry flatter = seen(T_query, -15.0, 5.0, 180.0), higher = seen(T_query, -20.0, 20.0, 180.0);
  const double typical = TypicalAgreement{}.in_sight_ratio;
  const GeometricEvidence alike = evidence(match, same), differing = evidence(match, flatter);
  EXPECT_FALSE(alike.evidence.sensors_differ);
  EXPECT_NEAR(alike.evidence.inlier_share, in_sight(match, same, alike) / typical, 1e-9);
  EXPECT_NEAR(alike.evidence.residual_share, alike.evidence.rmse_m / (1.0 * TypicalAgreement{}.residual), 1e-9);
  EXPECT_NEAR(differing.evidence.residual_share, differing.evidence.rmse_m / (1.13 * TypicalAgreement{}.residual), 1e-9)
      << "each thins what it sees by where its own lines lie";
  EXPECT_TRUE(differing.evidence.sensors_differ);
  EXPECT_NEAR(differing.evidence.inlier_share, in_sight(match, flatter, differing) / (typical * 0.8), 1e-9);
  EXPECT_TRUE(evidence(match, higher).evidence.sensors_differ) << "down a little less, and up much farther";

  const ScanGeometry sector = seen(T_query, -24.8, 5.0, 35.0), other_sector = seen(T_match, -24.8, 5.0, 35.0);
  EXPECT_FALSE(alike.evidence.one_is_narrow || alike.evidence.both_are_narrow);
  EXPECT_TRUE(evidence(match, sector).evidence.one_is_narrow);
  EXPECT_FALSE(evidence(match, sector).evidence.both_are_narrow);
  EXPECT_FALSE(evidence(other_sector, sector).evidence.one_is_narrow);
  EXPECT_TRUE(evidence(other_sector, sector).evidence.both_are_narrow);
  EXPECT_FALSE(evidence(match, seen(T_query, -24.8, 5.0, 120.0)).evidence.one_is_narrow) << "a lorry hides a third";
}

TEST(GeometricConsistency, FeaturesSaveAWrongYaw) {
  const Pose T_match = SyntheticWorld::at(0, 0, 0), T_query = SyntheticWorld::at(2, 1, to_radians(100.0));
  ScanGeometry match = scan_at(31, T_match), query = scan_at(31, T_query);
  EXPECT_FALSE(check_geometric(match, query, {planar_pose(0, 0, 0.0)}, {}).is_consistent());
  GeometricOptions options;
  options.features = "fallback";
  const GeometricEvidence evidence = check_geometric(match, query, {planar_pose(0, 0, 0.0)}, options);
  ASSERT_TRUE(evidence.is_consistent()) << evidence.refusal->value;
  EXPECT_TRUE(evidence.from_features);
  EXPECT_GT(evidence.feature_inliers, 9u);
  const Pose error = (T_match.inverse() * T_query).inverse() * evidence.T_match_query;
  EXPECT_LT(error.translation().norm(), 0.1);
}

TEST(GeometricConsistency, ThePapersOrderStartsFromFeatures) {
  const Pose T_match = SyntheticWorld::at(0, 0, 0), T_query = SyntheticWorld::at(2, 1, to_radians(100.0));
  ScanGeometry match = scan_at(31, T_match), query = scan_at(31, T_query);
  GeometricOptions options;
  options.features = "first";
  const GeometricEvidence evidence = check_geometric(match, query, {planar_pose(0, 0, to_radians(100.0))}, options);
  ASSERT_TRUE(evidence.is_consistent()) << evidence.refusal->value;
  EXPECT_TRUE(evidence.from_features) << "though the yaw was right";
}

TEST(GeometricConsistency, AnotherPlaceIsRefused) {
  for (const unsigned other : {32u, 33u, 34u}) {
    ScanGeometry match = scan_at(31, SyntheticWorld::at(0, 0, 0)), query = scan_at(other, SyntheticWorld::at(0, 0, 0));
    const GeometricEvidence evidence = check_geometric(match, query, {planar_pose(0, 0, 0.0)}, {});
    EXPECT_FALSE(evidence.is_consistent());
    ASSERT_TRUE(evidence.refusal);
    EXPECT_EQ(evidence.refusal->reason, Refusal::Reason::kFewInliers);
    EXPECT_LT(evidence.refusal->value, evidence.refusal->limit);
  }
}

TEST(GeometricConsistency, WhatMaySlideIsRefusedWhateverElseSpeaksForIt) {
  GeometricEvidence found;
  found.evidence = {
      .inlier_ratio = 0.95, .inlier_share = 1.0, .intensity_agreement = 1.0, .inliers = 1000, .stddev_m = 0.15};
  decide(found, 0.0, 100.0, {});
  ASSERT_TRUE(found.refusal);
  EXPECT_EQ(found.refusal->reason, Refusal::Reason::kSlides);
  found.evidence.stddev_m = 0.08;
  decide(found, 0.0, 100.0, {});
  EXPECT_FALSE(found.refusal);
}

TEST(GeometricConsistency, HowWellThePositionIsFixedGoesByWhatIsLeastFixed) {
  const auto stddev_m = [](bool with_end) {
    std::vector<Point> points;
    for (float x = -20.f; x <= 15.f; x += 0.25f)
      for (float z = 0.f; z <= 3.f; z += 0.25f)
        for (const float y : {-2.f, 2.f}) points.push_back({x, y + 0.02f * std::sin(40.f * x + 17.f * z), z, 0.f});
    for (float y = -2.f; with_end && y <= 2.f; y += 0.25f)
      for (float z = 0.f; z <= 3.f; z += 0.25f) points.push_back({15.f, y, z, 0.f});
    ScanGeometry corridor{thin(points, {}, 0.5)};
    return check_geometric(corridor, corridor, {planar_pose(0, 0, 0.0)}, {}).evidence.stddev_m;
  };
  EXPECT_LT(stddev_m(true), 0.15);
  EXPECT_GT(stddev_m(false), 3.0 * stddev_m(true)) << "nothing but noise fixes the way along the corridor";
}

TEST(GeometricConsistency, TooLongATranslationIsRefused) {
  GeometricEvidence found;
  found.evidence = {.inlier_ratio = 0.95,
                    .inlier_share = 1.0,
                    .free_space_agreement = 1.0,
                    .intensity_agreement = 1.0,
                    .least_fixed = 0.2,
                    .inliers = 1000,
                    .distance_m = 16.0};
  decide(found, 0.0, 0.0, {});
  ASSERT_TRUE(found.refusal);
  EXPECT_EQ(found.refusal->reason, Refusal::Reason::kTooFar);
  EXPECT_DOUBLE_EQ(found.refusal->value, 16.0);
}

TEST(GeometricConsistency, RefinementTakesWhatIsLeftOfTheErrorAndLeapsNowhere) {
  const Pose T_match = SyntheticWorld::at(0, 0, 0), T_query = SyntheticWorld::at(2, 1, to_radians(20.0));
  const ScanGeometry match = scan_at(31, T_match), query = scan_at(31, T_query);
  const Pose T_truth = T_match.inverse() * T_query;
  GeometricEvidence found;
  Vector6 off;
  off << 0.06, -0.05, 0.03, 0.004, -0.004, 0.006;
  found.T_match_query = T_truth * small_motion(off);
  refine(found, match, query);
  const Pose error = T_truth.inverse() * found.T_match_query;
  EXPECT_LT(error.translation().norm(), 0.02);
  EXPECT_LT(to_degrees(rotation_angle(error)), 0.05);
  EXPECT_GT(found.information(0, 0), 0.0);
  const Pose far = T_truth * planar_pose(0.3, 0, 0);
  found.T_match_query = far;
  refine(found, match, query);
  EXPECT_TRUE(found.T_match_query.isApprox(far)) << "what lies farther off was not what was judged";
}

TEST(GeometricConsistency, NothingToRegister) {
  ScanGeometry match = scan_at(31, SyntheticWorld::at(0, 0, 0)), nothing{ThinCloud{}};
  EXPECT_FALSE(check_geometric(match, nothing, {planar_pose(0, 0, 0.0)}, {}).is_consistent());
  EXPECT_FALSE(check_geometric(nothing, match, {planar_pose(0, 0, 0.0)}, {}).is_consistent());
}

TEST(Decide, OneScanOfARoomMustShowMoreToDecideAlone) {
  GeometricEvidence found;
  found.own_log_odds = 5.5;
  EXPECT_TRUE(found.decides_alone()) << "in the open";
  found.evidence.in_the_open = false;
  EXPECT_FALSE(found.decides_alone());
  found.own_log_odds = 6.0;
  EXPECT_TRUE(found.decides_alone());
  found.evidence.both_are_narrow = true;
  EXPECT_FALSE(found.decides_alone()) << "a sector of it";
  found.own_log_odds = 8.0;
  EXPECT_TRUE(found.decides_alone());
  found.evidence.one_is_narrow = true;
  EXPECT_FALSE(found.decides_alone());
}

TEST(Decide, WhatMeetsALimitIsAccepted) {
  GeometricEvidence found;
  found.evidence.inlier_ratio = 0.25;
  found.evidence.stddev_m = 0.1;
  found.evidence.distance_m = 15.0;
  GeometricOptions options;
  options.min_inlier_ratio = 0.25;
  options.min_probability = probability_of(loop_log_odds(found.evidence) + 1.0);
  decide(found, 0.0, 1.0, options);
  EXPECT_FALSE(found.refusal);
}

TEST(Decide, APriorDecidesWhereTheScansLeaveItOpen) {
  GeometricEvidence found;
  found.evidence = {.inlier_ratio = 0.5,
                    .inlier_share = 0.75,
                    .free_space_agreement = 0.92,
                    .intensity_agreement = 0.8,
                    .rmse_m = 0.17,
                    .overlap = 0.7,
                    .least_fixed = 0.2,
                    .inliers = 1000,
                    .distance_m = 0.5};
  const double own = loop_log_odds(found.evidence);
  ASSERT_GT(own, -1.5);
  ASSERT_LT(own, 2.5) << "neither sure nor refuted";
  decide(found, 0.0, 0.0, {});
  EXPECT_FALSE(found.is_consistent());
  EXPECT_EQ(found.refusal->reason, Refusal::Reason::kImprobable);
  decide(found, 0.0, 6.5, {});
  EXPECT_TRUE(found.is_consistent());
  EXPECT_NEAR(found.log_odds, own + 6.5, 1e-9);
  found.evidence.inlier_ratio = 0.2;
  decide(found, 0.0, 100.0, {});
  EXPECT_FALSE(found.is_consistent()) << "too few inliers, whatever else speaks for it";
}

}  // namespace
}  // namespace revisit
