// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <random>

#include <gtest/gtest.h>

#include <pcl/features/fpfh.h>
#include <pcl/point_types.h>
#include <pcl/search/kdtree.h>

#include <revisit/registration/agreement.hpp>
#include <revisit/registration/feature_alignment.hpp>
#include <revisit/registration/icp.hpp>

#include "thin_scan.hpp"

namespace revisit {
namespace {

using testing_support::error_deg;
using testing_support::error_m;
using testing_support::SyntheticWorld;
using testing_support::thin_scan;

TEST(Thin, OnePointAVoxelWhateverTheOrder) {
  const std::vector<Point> points = {
      {0.1f, 0.1f, 0.1f, 0}, {0.3f, 0.1f, 0.1f, 0}, {1.5f, 0.f, 0.f, 0}, {-0.1f, 0.f, 0.f, 0}};
  const ThinCloud cloud = thin(points, std::vector<std::uint8_t>{1, 1, 0, 0}, 1.0);
  EXPECT_EQ(cloud.points.size(), 3u);
  std::vector<Point> reversed(points.rbegin(), points.rend());
  const ThinCloud again = thin(reversed, {}, 1.0);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_LT((cloud.points[i] - again.points[i]).norm(), 1e-6f);
  EXPECT_EQ(cloud.is_ground[1], 1) << "both points of the voxel are ground";
  EXPECT_TRUE(thin({}, {}, 1.0).points.empty());
}

TEST(SurfaceCloud, NormalsOfAPlane) {
  ThinCloud plane;
  for (int i = 0; i < 20; ++i)
    for (int j = 0; j < 20; ++j)
      plane.points.emplace_back(static_cast<float>(i), static_cast<float>(j), 0.5f * static_cast<float>(i));
  const SurfaceCloud cloud(plane);
  const Eigen::Vector3f expected = Eigen::Vector3f(-0.5f, 0.f, 1.f).normalized();
  for (std::size_t i = 0; i < cloud.size(); ++i) EXPECT_NEAR(std::abs(cloud.normal(i).dot(expected)), 1.f, 1e-3f);
  ASSERT_TRUE(cloud.nearest(Eigen::Vector3f(3.2f, 4.1f, 1.5f)));
  EXPECT_EQ(cloud.nearest(Eigen::Vector3f(3.2f, 4.1f, 1.5f))->index, 3u * 20u + 4u);
  EXPECT_FALSE(cloud.nearest(Eigen::Vector3f(3.2f, 4.1f, 9.5f), 4.f)) << "none within 2 m";
}

TEST(SurfaceCloud, ASingleLineHasNoSide) {
  // Level ground where a sensor of few lines sees a line every 3 m, and one line far from all others.
  std::mt19937 random(7);
  std::normal_distribution<float> noise(0.f, 0.02f);
  std::vector<Point> points;
  const auto add_line = [&](float y) {
    for (float x = -20.f; x < 20.f; x += 0.5f) points.push_back({x, y, noise(random), 0.f});
  };
  for (const float y : {-6.f, -3.f, 0.f, 3.f}) add_line(y);
  add_line(30.f);
  const SurfaceCloud cloud(thin(points, {}, 1.0));
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    if (cloud.point(i).y() > 20.f)
      EXPECT_TRUE(cloud.normal(i).isZero()) << cloud.point(i).transpose();
    else
      EXPECT_GT(std::abs(cloud.normal(i).z()), 0.999f) << cloud.point(i).transpose();
  }
}

TEST(SurfaceCloud, NearestIsThatOfTryingAllWhateverTheReach) {
  std::mt19937 random(4);
  ThinCloud cloud;
  for (int i = 0; i < 500; ++i) {
    const auto within = [&](float metres) { return std::uniform_real_distribution<float>(-metres, metres)(random); };
    cloud.points.emplace_back(within(30.f), within(10.f), i % 7 == 0 ? within(100.f) : within(3.f));
  }
  cloud.points.emplace_back(5000.f, 0.f, 0.f);  // beyond the grid's edge
  for (const float voxel_m : {0.3f, 1.f, 5.f}) {
    cloud.voxel_m = voxel_m;
    const SurfaceCloud surface(cloud);
    for (const float reach_m : {0.5f, 2.f, 7.3f, std::numeric_limits<float>::infinity()})
      for (std::size_t q = 0; q < 500; q += 3) {
        const Eigen::Vector3f query = cloud.points[q] * 1.3f + Eigen::Vector3f(0.2f, -0.4f, 0.1f);
        float least = reach_m * reach_m;
        for (const auto& p : cloud.points) least = std::min(least, (p - query).squaredNorm());
        const auto found = surface.nearest(query, reach_m * reach_m);
        ASSERT_EQ(found.has_value(), least < reach_m * reach_m) << query.transpose() << ", " << reach_m << " m";
        if (found) {
          ASSERT_FLOAT_EQ(found->squared_distance_m2, least);
          ASSERT_FLOAT_EQ((cloud.points[found->index] - query).squaredNorm(), least);
        }
      }
  }
}

TEST(Agreement, WallsThatTheOtherScanSawThroughCount) {
  // The same room, once with a wall across it, which stands where the other scan saw the far side.
  const auto room = [](bool with_wall) {
    std::vector<Point> points;
    for (int i = 0; i < 200; ++i)
      for (int level = 0; level < 12; ++level) {
        const auto along = 0.2f * static_cast<float>(i) - 20.f, z = 0.5f * static_cast<float>(level);
        const float intensity = i % 20 < 10 ? 0.2f : 0.8f;
        for (const float side : {-20.f, 20.f}) {
          points.push_back({along, side, z, intensity});
          if (!(with_wall && side > 0 && std::abs(along) < 10.f)) points.push_back({side, along, z, intensity});
        }
        if (with_wall && level < 6 && std::abs(along) < 5.f) points.push_back({10.f, along, z, intensity});
      }
    return SurfaceCloud(thin(points, {}, 1.0));
  };
  const SurfaceCloud open = room(false), walled = room(true);
  const Agreement same = measure_agreement(open, open, Pose::Identity(), 0.4);
  EXPECT_DOUBLE_EQ(same.free_space_agreement, 1.0);
  ASSERT_TRUE(same.intensity_correlation);
  EXPECT_NEAR(*same.intensity_correlation, 1.0, 1e-6);
  const Agreement differing = measure_agreement(open, walled, Pose::Identity(), 0.4);
  EXPECT_LT(differing.free_space_agreement, 0.97);
  EXPECT_GT(differing.free_space_agreement, 0.8) << "what the wall hides is no dispute";
  EXPECT_GT(differing.hidden_share, 0.05);
  EXPECT_GT(differing.in_sight_ratio, differing.inlier_ratio + 0.05) << "and nothing that does not fit";
}

TEST(Agreement, IntensitiesAreComparedWhereThereAreAny) {
  std::vector<Point> points, other, plain;
  std::mt19937 random(3);
  for (int i = 0; i < 60; ++i)
    for (int j = 0; j < 60; ++j) {
      const auto shade = [&] { return static_cast<float>(random() % 100) / 100.f; };
      const Point p{static_cast<float>(i) - 29.5f, static_cast<float>(j) - 29.5f, 2.5f, shade()};
      points.push_back(p);
      other.push_back({p.x, p.y, p.z, shade()});
      plain.push_back({p.x, p.y, p.z, 0.5f});
    }
  const SurfaceCloud a(thin(points, {}, 1.0)), b(thin(other, {}, 1.0)), c(thin(plain, {}, 1.0));
  EXPECT_GT(measure_agreement(a, a, Pose::Identity(), 0.4).intensity_correlation.value_or(0.0), 0.99);
  EXPECT_LT(std::abs(measure_agreement(a, b, Pose::Identity(), 0.4).intensity_correlation.value_or(1.0)), 0.1);
  EXPECT_FALSE(measure_agreement(a, c, Pose::Identity(), 0.4).intensity_correlation) << "all alike";
}

// A sensor that looks up beside one that looks down: what only one of them can see is no disagreement. Nor is another
// response to the same surface.
TEST(Agreement, OfTwoSensorsCountsWhatBothCanSee) {
  const auto scan = [](double down_deg, double up_deg) {
    Scan taken = SyntheticWorld(31).scan(SyntheticWorld::at(0, 0, 0), {32, 900, down_deg, up_deg});
    return taken.points;
  };
  const SurfaceCloud high(thin(scan(-6.0, 30.0), {}, 1.0));
  std::vector<Point> below = scan(-24.8, 2.0);
  const SurfaceCloud low(thin(below, {}, 1.0));
  const Agreement agreement = measure_agreement(high, low, Pose::Identity(), 0.4);
  EXPECT_GT(agreement.inlier_ratio, 0.42) << "0.35 of all points";
  for (Point& p : below) p.intensity *= p.intensity;
  const Agreement curved = measure_agreement(low, SurfaceCloud(thin(below, {}, 1.0)), Pose::Identity(), 0.4);
  EXPECT_GT(curved.intensity_correlation.value_or(0.0), 0.95);
}

TEST(ThinForRegistration, WhatFillsFewVoxelsIsThinnedFiner) {
  std::vector<Point> room, street;
  for (float x = -3.f; x < 3.f; x += 0.1f)
    for (float z = -1.f; z < 2.f; z += 0.1f) room.push_back({x, 4.f, z, 0.f});
  for (float x = -60.f; x < 60.f; x += 0.5f)
    for (float y = -30.f; y < 30.f; y += 0.5f) street.push_back({x, y, -1.7f, 0.f});
  EXPECT_EQ(thin_for_registration(room, {}).voxel_m, 0.5f);
  EXPECT_EQ(thin_for_registration(street, {}).voxel_m, 1.f);
  EXPECT_EQ(thin_for_registration({}, {}).points.size(), 0u);
}

TEST(SurfaceCloud, ANarrowViewOfAStreetIsInTheOpen) {
  const auto wall = [](float from_m, float to_m) {
    std::vector<Point> points;
    for (float x = from_m; x < to_m; x += 0.2f)
      for (float z = -1.f; z < 2.f; z += 0.2f) points.push_back({x, 4.f, z, 0.f});
    return SurfaceCloud(thin_for_registration(points, {}));
  };
  const SurfaceCloud ahead = wall(5.f, 70.f);
  EXPECT_EQ(ahead.voxel_m(), 0.5) << "few voxels";
  EXPECT_TRUE(ahead.is_in_the_open());
  EXPECT_FALSE(wall(-20.f, 40.f).is_in_the_open()) << "a corridor";
  ThinCloud nothing;
  nothing.voxel_m = 0.5f;
  EXPECT_FALSE(SurfaceCloud(nothing).is_in_the_open());
}

// What beams from 15 degrees below to so many above, by their azimuth, meet at one range.
template <typename HighestDeg>
std::vector<Point> met_at(float range_m, HighestDeg highest_deg) {
  std::vector<Point> points;
  for (int azimuth = 0; azimuth < 360; ++azimuth)
    for (int elevation = -15; elevation <= highest_deg(azimuth); ++elevation) {
      const double yaw_rad = to_radians(azimuth + 0.5), pitch_rad = to_radians(elevation);
      points.push_back({static_cast<float>(range_m * std::cos(pitch_rad) * std::cos(yaw_rad)),
                        static_cast<float>(range_m * std::cos(pitch_rad) * std::sin(yaw_rad)),
                        static_cast<float>(range_m * std::sin(pitch_rad)), 0.5f});
    }
  return points;
}

TEST(SurfaceCloud, AViewCutOffIsInTheOpenWhereItIsNotClosedIn) {
  // The first azimuths are open, those from `end_deg` on are not seen.
  const auto sees = [](float range_m, int open_deg, int highest_deg, int end_deg) {
    const auto highest_at = [=](int azimuth) {
      return azimuth >= end_deg ? -16 : azimuth < open_deg ? -3 : highest_deg;
    };
    return SurfaceCloud(thin(met_at(range_m, highest_at), {}, 0.5)).is_in_the_open();
  };
  EXPECT_TRUE(sees(24.f, 90, 5, 360));
  EXPECT_FALSE(sees(24.f, 0, 5, 360)) << "a hall";
  EXPECT_FALSE(sees(12.f, 90, 5, 360)) << "the walls of a hall may be farther away";
  EXPECT_FALSE(sees(24.f, 90, 0, 360)) << "nothing looks up";
  EXPECT_FALSE(sees(24.f, 90, 5, 200)) << "a narrow view fills few azimuths";
}

TEST(SurfaceCloud, BeneathARoofIsNoOpen) {
  const auto sees = [](float range_m, int highest_deg) {
    return SurfaceCloud(thin(met_at(range_m, [=](int) { return highest_deg; }), {}, 1.0)).is_in_the_open();
  };
  EXPECT_FALSE(sees(45.f, 15)) << "a hall";
  EXPECT_TRUE(sees(65.f, 15)) << "a street between trees";
  EXPECT_FALSE(sees(65.f, 44)) << "a large hall";
}

TEST(Agreement, AWallFixesNothingAlongItself) {
  std::vector<Point> wall, corner;
  for (float x = -8.f; x < 8.f; x += 0.2f)
    for (float z = -1.f; z < 2.f; z += 0.2f) {
      wall.push_back({x, 5.f, z, 0.f});
      corner.push_back({x, 5.f, z, 0.f});
      corner.push_back({8.f, 5.f - (x + 8.f), z, 0.f});
    }
  const auto least_fixed = [](const std::vector<Point>& points) {
    const SurfaceCloud cloud(thin(points, {}, 0.5));
    return measure_agreement(cloud, cloud, Pose::Identity(), 0.2).least_fixed;
  };
  EXPECT_LT(least_fixed(wall), 0.02);
  EXPECT_GT(least_fixed(corner), 0.3);
}

TEST(SeenSpace, PutsPointsWhereExactAnglesDo) {
  std::mt19937 random(7);
  std::uniform_real_distribution<float> metres(-60.f, 60.f);
  constexpr double kCellsADegree = 1.0 / 3.0;
  int compared = 0;
  for (int i = 0; i < 20000; ++i) {
    const Point p{metres(random), metres(random), metres(random) / 2.f, 0.f};
    const double azimuth = kCellsADegree * (to_degrees(std::atan2(double{p.y}, double{p.x})) + 180.0);
    const double elevation = kCellsADegree * (to_degrees(std::atan2(double{p.z}, std::hypot(p.x, p.y))) + 45.0);
    const auto is_open = [](double cells) { return std::abs(cells - std::round(cells)) < 1e-4; };
    if (elevation < 0.0 || elevation >= 30.0 || is_open(azimuth) || is_open(elevation)) continue;
    const auto ranges = SeenSpace(std::span(&p, 1)).ranges_cm();
    ASSERT_EQ(ranges.size(), 2u * 120u * 30u);
    const auto cell = static_cast<std::size_t>(azimuth) * 30 + static_cast<std::size_t>(elevation);
    ASSERT_GT(ranges[2 * cell + 1], 0) << azimuth << ", " << elevation;
    ++compared;
  }
  EXPECT_GT(compared, 15000);
}

// Beams up to so many degrees, of which those above 3 degrees meet nothing in an open part of the circle.
SeenSpace seen_below(int highest_deg, int open_deg) {
  return SeenSpace(
      met_at(10.f, [=](int azimuth) { return azimuth < open_deg ? std::min(highest_deg, 3) : highest_deg; }));
}

TEST(SeenSpace, ARoofIsSeenAllRoundByWhatLooksUp) {
  EXPECT_TRUE(seen_below(15, 0).is_roofed());
  EXPECT_TRUE(seen_below(44, 12).is_roofed()) << "a gate";
  EXPECT_FALSE(seen_below(15, 30).is_roofed()) << "a street, at one end";
  EXPECT_FALSE(seen_below(15, 340).is_roofed()) << "a tower";
  EXPECT_FALSE(seen_below(2, 0).is_roofed()) << "nothing looks up";
  EXPECT_FALSE(SeenSpace().is_roofed());
}

TEST(SeenSpace, AStreetIsOpenWhereNothingIsWithinReach) {
  // Walls, and a gap in which beams come back up to so many degrees.
  const auto with_gap = [](int gap_deg, int highest_deg) {
    return SeenSpace(met_at(10.f, [=](int azimuth) { return azimuth < gap_deg ? highest_deg : 5; }))
        .is_open_to_the_sides();
  };
  EXPECT_FALSE(with_gap(0, -3));
  EXPECT_FALSE(with_gap(42, -3)) << "a door, a window";
  EXPECT_TRUE(with_gap(51, -3)) << "a street";
  EXPECT_FALSE(with_gap(51, 5)) << "walls all round";
  EXPECT_FALSE(SeenSpace().is_open_to_the_sides());
}

TEST(SeenSpace, KnowsWhatLiesBeforeAndBehind) {
  std::vector<Point> points;
  for (int i = 0; i < 100; ++i) points.push_back({20.f, -1.f + 0.02f * static_cast<float>(i), 0.1f, 0.f});
  const SeenSpace seen(points);
  using Verdict = SeenSpace::Verdict;
  EXPECT_EQ(seen.look({10.f, 0.2f, 0.1f}, 1.f), Verdict::kThrough);
  EXPECT_EQ(seen.look({19.5f, 0.2f, 0.1f}, 1.f), Verdict::kSurface);
  EXPECT_EQ(seen.look({30.f, 0.2f, 0.1f}, 1.f), Verdict::kHidden);
  EXPECT_EQ(seen.look({-10.f, 0.2f, 0.1f}, 1.f), Verdict::kUnknown);
  EXPECT_EQ(seen.look({0.f, 0.2f, 40.f}, 1.f), Verdict::kUnknown) << "above what is kept";
  EXPECT_EQ(SeenSpace().look({10.f, 0.f, 0.f}, 1.f), Verdict::kUnknown);
}

TEST(Features, FindATurnWithoutAnyGuess) {
  const Pose T_a = SyntheticWorld::at(0, 0, 0), T_b = SyntheticWorld::at(1.5, -0.5, to_radians(140.0));
  const SurfaceCloud a(thin_scan(T_a)), b(thin_scan(T_b, 2));
  const auto result = align_features(a, compute_features(a, 3.0), b, compute_features(b, 3.0));
  ASSERT_TRUE(result);
  const Pose T_truth = T_a.inverse() * T_b;
  EXPECT_LT(error_m(result->T_target_source, T_truth), 1.5);
  EXPECT_LT(error_deg(result->T_target_source, T_truth), 5.0);
  const SurfaceCloud nothing(ThinCloud{});
  EXPECT_FALSE(align_features(a, compute_features(a, 3.0), nothing, compute_features(nothing, 3.0)));
}

// PCL leaves out a point's own histogram and picks other frames where two angles are alike: near, not equal.
TEST(Features, AreNearlyThoseOfPcl) {
  const SurfaceCloud cloud(thin_scan(SyntheticWorld::at(0, 0, 0)));
  const Features ours = compute_features(cloud, 3.0);
  pcl::PointCloud<pcl::PointXYZ>::Ptr points(new pcl::PointCloud<pcl::PointXYZ>);
  pcl::PointCloud<pcl::Normal>::Ptr normals(new pcl::PointCloud<pcl::Normal>);
  for (const std::size_t i : ours.points) {
    const Eigen::Vector3f& p = cloud.point(i);
    const Eigen::Vector3f n = cloud.normal(i).dot(p) > 0.f ? Eigen::Vector3f(-cloud.normal(i)) : cloud.normal(i);
    points->emplace_back(p.x(), p.y(), p.z());
    normals->emplace_back(n.x(), n.y(), n.z());
  }
  pcl::FPFHEstimation<pcl::PointXYZ, pcl::Normal, pcl::FPFHSignature33> estimation;
  estimation.setInputCloud(points);
  estimation.setInputNormals(normals);
  estimation.setSearchMethod(pcl::search::KdTree<pcl::PointXYZ>::Ptr(new pcl::search::KdTree<pcl::PointXYZ>));
  estimation.setRadiusSearch(3.0);
  pcl::PointCloud<pcl::FPFHSignature33> theirs;
  estimation.compute(theirs);
  ASSERT_EQ(theirs.size(), ours.points.size());
  std::vector<float> cosines;
  for (std::size_t i = 0; i < theirs.size(); ++i) {
    const Eigen::Map<const Eigen::Matrix<float, 33, 1>> other(theirs[i].histogram);
    const auto own = ours.values.col(static_cast<Eigen::Index>(i));
    if (other.allFinite() && other.norm() > 0.f && own.norm() > 0.f)
      cosines.push_back(own.dot(other) / (own.norm() * other.norm()));
  }
  ASSERT_GT(cosines.size(), 300u);
  std::nth_element(cosines.begin(), cosines.begin() + static_cast<std::ptrdiff_t>(cosines.size() / 2), cosines.end());
  EXPECT_GT(cosines[cosines.size() / 2], 0.9f);
}

}  // namespace
}  // namespace revisit
