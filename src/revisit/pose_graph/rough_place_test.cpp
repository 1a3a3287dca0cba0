// SPDX-License-Identifier: Apache-2.0
#include <revisit/pose_graph/internal/rough_place.hpp>

#include <random>

#include <gtest/gtest.h>

namespace revisit::pose_graph_internal {
namespace {

// Fixes of a way: exactly where T has it, but for noise.
FixPairs fixes_of(const std::vector<Eigen::Vector3d>& way, const Pose& T, double noise_m, double deviation_m = 0.5,
                  unsigned seed = 3) {
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0.0, 1.0);
  FixPairs pairs;
  for (const Eigen::Vector3d& each : way) {
    pairs.world.push_back(each);
    pairs.earth.push_back(T * each + noise_m * Eigen::Vector3d(noise(random), noise(random), noise(random)));
    pairs.deviation_m.push_back(deviation_m);
  }
  return pairs;
}

std::vector<Eigen::Vector3d> straight_way(std::size_t count = 40) {
  std::vector<Eigen::Vector3d> way;
  for (std::size_t i = 0; i < count; ++i)
    way.emplace_back(5.6 * static_cast<double>(i), 3.0 - 4.2 * static_cast<double>(i), 0.0);
  return way;
}

// Over a hill and round a bend.
std::vector<Eigen::Vector3d> bent_way() {
  std::vector<Eigen::Vector3d> way;
  for (int i = 0; i < 60; ++i) {
    const double a = 0.05 * i;
    way.emplace_back(100.0 * std::cos(a), 100.0 * std::sin(a), 20.0 * std::sin(3.0 * a));
  }
  return way;
}

Pose somewhere(double yaw_rad, double tilt_rad) {
  Pose T = Pose::Identity();
  T.translate(Eigen::Vector3d(4000.0, -700.0, 30.0));
  T.rotate(Eigen::AngleAxisd(yaw_rad, Eigen::Vector3d::UnitZ()) *
           Eigen::AngleAxisd(tilt_rad, Eigen::Vector3d(1.0, 2.0, 0.0).normalized()));
  return T;
}

void expect_near(const Pose& found, const Pose& expected, const std::vector<Eigen::Vector3d>& way, double most_m) {
  for (const Eigen::Vector3d& each : way) EXPECT_LT((found * each - expected * each).norm(), most_m);
}

TEST(RoughPlace, AStraightWayIsPlacedUpright) {
  for (const double yaw_rad : {-2.5, -0.4, 0.5, 2.0}) {
    const Pose T = somewhere(yaw_rad, 0.0);
    const auto rough = place_roughly(fixes_of(straight_way(), T, 0.0));
    ASSERT_TRUE(rough);
    expect_near(rough->T_earth_world, T, straight_way(), 1e-6);
    EXPECT_TRUE(rough->T_earth_world.linear().isApprox(T.linear(), 1e-9)) << "nor does it lean about its way";
  }
}

TEST(RoughPlace, ABentWayTellsHowItLeans) {
  for (const double yaw_rad : {-2.5, -0.4, 0.5, 2.0})
    for (const double tilt_rad : {0.0, 0.3, 1.5}) {
      const Pose T = somewhere(yaw_rad, tilt_rad);
      const auto rough = place_roughly(fixes_of(bent_way(), T, 0.0));
      ASSERT_TRUE(rough);
      expect_near(rough->T_earth_world, T, bent_way(), 1e-6);
      const auto noisy = place_roughly(fixes_of(bent_way(), T, 0.5));
      ASSERT_TRUE(noisy);
      expect_near(noisy->T_earth_world, T, bent_way(), 1.0);
    }
}

// 29 of 60 fixes agree with each other on another place, 80 m beside.
TEST(RoughPlace, NearlyHalfOfTheFixesMayAgreeElsewhere) {
  const Pose T = somewhere(1.0, 0.1);
  FixPairs pairs = fixes_of(bent_way(), T, 0.5);
  for (std::size_t i = 0; i < 29; ++i) pairs.earth[2 * i] += Eigen::Vector3d(80.0, 0.0, 0.0);
  const auto rough = place_roughly(pairs);
  ASSERT_TRUE(rough);
  expect_near(rough->T_earth_world, T, bent_way(), 2.0);
  for (std::size_t i = 0; i < pairs.world.size(); ++i) EXPECT_EQ(rough->is_near[i], i % 2 == 1 || i >= 58) << i;
}

TEST(RoughPlace, CountsFixesByTheirDeviation) {
  const Pose T = somewhere(1.0, 0.0);
  FixPairs pairs = fixes_of(straight_way(), T, 0.0);
  for (std::size_t i = 0; i < 15; ++i) {  // off by their deviation, all to one side
    pairs.deviation_m[i] = 10.0;
    pairs.earth[i] += Eigen::Vector3d(0.0, 10.0, 0.0);
  }
  const auto rough = place_roughly(pairs);
  ASSERT_TRUE(rough);
  expect_near(rough->T_earth_world, T, straight_way(), 0.3);
  for (const bool is_near : rough->is_near) EXPECT_TRUE(is_near);
}

// A way along x that leaves it by 10 m to both sides.
std::vector<Eigen::Vector3d> winding_way() {
  std::vector<Eigen::Vector3d> way;
  for (int i = 0; i < 60; ++i) way.emplace_back(5.0 * i, i / 2 % 2 == 0 ? 10.0 : -10.0, 0.0);
  return way;
}

// How it leans is told by what spreads across by eight deviations of the fixes.
TEST(RoughPlace, AWayThatHardlyWindsIsPlacedUpright) {
  const Pose T = somewhere(1.0, 0.1);
  for (const auto& [deviation_m, upright] : {std::pair{1.2, false}, {1.3, true}}) {
    const auto rough = place_roughly(fixes_of(winding_way(), T, 0.0, deviation_m));
    ASSERT_TRUE(rough);
    EXPECT_EQ(rough->T_earth_world.linear().col(2).isApprox(Eigen::Vector3d::UnitZ(), 1e-9), upright) << deviation_m;
  }
}

// Fixes that are all off by ten of what they claim count all the same: the place is their mean, not that of a few.
TEST(RoughPlace, FixesThatClaimTooMuchAreNoOutliers) {
  const Pose T = somewhere(1.0, 0.0);
  double squares = 0.0;
  for (unsigned seed = 0; seed < 20; ++seed) {
    const auto rough = place_roughly(fixes_of(straight_way(), T, 5.0, 0.5, seed));
    ASSERT_TRUE(rough);
    squares += (rough->T_earth_world * straight_way()[20] - T * straight_way()[20]).squaredNorm() / 20.0;
  }
  EXPECT_LT(std::sqrt(squares), 2.0) << "5 m in three coordinates over the root of 40: 1.4 m";
}

TEST(RoughPlace, NeedsFourFixesThatSpread) {
  const Pose T = somewhere(1.0, 0.0);
  EXPECT_FALSE(place_roughly(fixes_of({}, T, 0.0)));
  EXPECT_FALSE(place_roughly(fixes_of(straight_way(3), T, 0.0)));
  EXPECT_TRUE(place_roughly(fixes_of(straight_way(4), T, 0.0)));
  // Standard deviation along four places 7 m apart: 7.8 m; asked are four of the fixes'.
  EXPECT_TRUE(place_roughly(fixes_of(straight_way(4), T, 0.0, 1.9)));
  EXPECT_FALSE(place_roughly(fixes_of(straight_way(4), T, 0.0, 2.0)));
}

}  // namespace
}  // namespace revisit::pose_graph_internal
