// SPDX-License-Identifier: Apache-2.0
#include <revisit/descriptors/baseline.hpp>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <gtest/gtest.h>

#include <revisit/core/pose.hpp>

#include "made_place.hpp"

namespace revisit {
namespace {

using testing_support::made_place;
using testing_support::moved;
using testing_support::turned;

// STD cuts the place into cubes: other ones, unless it is turned by a right angle.
double large_turn_rad(const Baseline& method) { return to_radians(method.name() == "std" ? 90.0 : 66.0); }

class EachBaseline : public testing::TestWithParam<std::size_t> {
 protected:
  const std::unique_ptr<Baseline> method = std::move(make_baselines()[GetParam()]);
};

TEST_P(EachBaseline, FindsThePlaceAgainWhenTurned) {
  // Principal axes may come out with the other sign: of M2DP only a slight turn is asked.
  const double yaw_rad = method->name() == "m2dp" ? to_radians(1.0) : large_turn_rad(*method);
  std::vector<Baseline::Signature> places;
  for (unsigned seed = 0; seed < 12; ++seed) places.push_back(method->describe(made_place(seed), -1.7));
  for (unsigned seed = 0; seed < 12; ++seed) {
    const auto query = method->describe(turned(made_place(seed), yaw_rad), -1.7);
    std::size_t best = 0;
    for (std::size_t i = 0; i < places.size(); ++i)
      if (method->similarity(query, places[i]) > method->similarity(query, places[best])) best = i;
    EXPECT_EQ(best, seed);
  }
}

TEST_P(EachBaseline, APlaceIsMostLikeItself) {
  const auto a = method->describe(made_place(1), -1.7), b = method->describe(made_place(2), -1.7);
  EXPECT_GT(method->similarity(a, a), method->similarity(a, b));
  EXPECT_TRUE(method->describe({}, -1.7).values.allFinite());
  auto far = made_place(1);
  far.push_back({1e10f, 3.f, 1.f, 0.f});
  far.push_back({3.f, -1e10f, 1e10f, 0.f});
  if (method->name() != "m2dp") {  // which centres the cloud
    EXPECT_GT(method->similarity(method->describe(far, -1.7), a), 0.99 * method->similarity(a, a));
  }
}

TEST_P(EachBaseline, SaysHowTheQueryLiesToThePlace) {
  const auto place = method->describe(made_place(1), -1.7);
  const bool is_moved = method->gives() >= Baseline::Gives::kPlanarPose;
  // T_place_query: the query's sensor heads so far to the right, 4 m ahead and 2 m to the right of the place's.
  const auto query = method->describe(
      turned(is_moved ? moved(made_place(1), 4.f, -2.f) : made_place(1), large_turn_rad(*method)), -1.7);
  const Pose T_place_query = method->T_place_query(query, place);
  if (method->gives() == Baseline::Gives::kPlace) {
    EXPECT_TRUE(T_place_query.isApprox(Pose::Identity()));
    return;
  }
  EXPECT_NEAR(to_degrees(yaw_of(T_place_query) + large_turn_rad(*method)), 0.0,
              method->name().starts_with("isc-paper") ? 9.0 : 3.0);
  if (!is_moved) return;
  EXPECT_NEAR(T_place_query.translation().x(), 4.0, 0.5);
  EXPECT_NEAR(T_place_query.translation().y(), -2.0, 0.5);
  EXPECT_NEAR(T_place_query.translation().z(), 0.0, 0.1);
}

INSTANTIATE_TEST_SUITE_P(Methods, EachBaseline, testing::Range(std::size_t{0}, make_baselines().size()),
                         [](const auto& each) {
                           std::string name = make_baselines()[each.param]->name();
                           std::replace_if(
                               name.begin(), name.end(), [](char c) { return c == '-' || c == '+'; }, '_');
                           return name;
                         });

std::unique_ptr<Baseline> baseline_of(const std::string& name) {
  for (auto& each : make_baselines())
    if (each->name() == name) return std::move(each);
  throw std::invalid_argument(name);
}

TEST(ScanContextBaseline, TurnedByWholeSectorsItIsTheSame) {
  const auto method = baseline_of("scan-context");
  const auto place = method->describe(made_place(3), -1.7);
  EXPECT_NEAR(method->similarity(place, place), 1.0, 1e-5);
  Baseline::Signature shifted = place;
  const Eigen::Index sectors = place.values.cols();
  for (Eigen::Index j = 0; j < sectors; ++j) shifted.values.col((j + 17) % sectors) = place.values.col(j);
  EXPECT_NEAR(method->similarity(place, shifted), 1.0, 1e-5);
}

// A lane beside: what Scan Context++ was made for.
TEST(ScanContextPlusPlusBaseline, ALaneBesideItIsMoreAlikeThanScanContext) {
  const auto augmented = baseline_of("scan-context++"), plain = baseline_of("scan-context");
  const auto place = made_place(4), query = moved(made_place(4), 0.f, 2.f);
  const auto similarity = [&](const Baseline& method) {
    return method.similarity(method.describe(query, -1.7), method.describe(place, -1.7));
  };
  EXPECT_NEAR(similarity(*augmented), 1.0, 1e-4);
  EXPECT_LT(similarity(*plain), 0.95);
}

// Moved cells keep their Radon transform but for a shift of its offsets, whose magnitudes do not see it.
TEST(RingBaseline, AMovedPlaceIsTheSame) {
  const auto method = baseline_of("ring");
  const auto place = method->describe(made_place(5), -1.7), other = method->describe(made_place(6), -1.7);
  const float cell_m = 140.f / 120.f;
  const auto query = method->describe(moved(made_place(5), 4 * cell_m, -3 * cell_m), -1.7);
  EXPECT_GT(method->similarity(query, place), 0.7);
  EXPECT_GT(method->similarity(query, place), method->similarity(query, other) + 0.3);
}

TEST(LidarIrisBaseline, TurnedByWholeColumnsItIsTheSame) {
  const auto method = baseline_of("lidar-iris");
  const auto place = made_place(7);
  EXPECT_DOUBLE_EQ(method->similarity(method->describe(place, -1.7), method->describe(place, -1.7)), 1.0);
  EXPECT_GT(method->similarity(method->describe(turned(place, to_radians(90.0)), -1.7), method->describe(place, -1.7)),
            0.95);
}

// Pairs of keypoints do not change where the sensor is moved, as long as it sees the same ones.
TEST(Glarot3dBaseline, AMovedPlaceIsTheSame) {
  const auto method = baseline_of("glarot3d");
  auto place = made_place(8);
  std::erase_if(place, [](const Point& p) { return std::hypot(p.x, p.y) > 30.f; });
  const auto query = method->describe(moved(place, 4.f, -3.f), -1.7);
  EXPECT_NEAR(method->similarity(query, method->describe(place, -1.7)), 1.0, 1e-3);
  EXPECT_LT(method->similarity(query, method->describe(made_place(9), -1.7)), 0.8);
}

TEST(SolidBaseline, TurnsDoNotMatterAndItKeepsAHundredNumbers) {
  const auto method = baseline_of("solid");
  const auto place = made_place(10);
  const auto signature = method->describe(place, -1.7);
  EXPECT_EQ(signature.bytes(), (40 + 60) * sizeof(float));
  EXPECT_NEAR(method->similarity(signature, method->describe(turned(place, to_radians(66.0)), -1.7)), 1.0, 0.02);
}

TEST(PublishedIscBaseline, OccupiedCellsNeverAgree) {
  const auto method = baseline_of("isc-program");
  // All cells occupied, alike in both: geometry sees no cell that agrees, intensity no difference.
  const Baseline::Signature full{Eigen::MatrixXf::Constant(20, 60, 100.f), {}};
  EXPECT_DOUBLE_EQ(method->similarity(full, full), 1.0);
  const Baseline::Signature empty{Eigen::MatrixXf::Zero(20, 60), {}}, ones{Eigen::MatrixXf::Ones(20, 60), {}};
  EXPECT_DOUBLE_EQ(method->similarity(empty, empty), 2.0);
  EXPECT_DOUBLE_EQ(method->similarity(ones, ones), 2.0);
}

}  // namespace
}  // namespace revisit
