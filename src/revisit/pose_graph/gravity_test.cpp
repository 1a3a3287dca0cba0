// SPDX-License-Identifier: Apache-2.0
#include <revisit/pose_graph/gravity.hpp>

#include <algorithm>
#include <cmath>
#include <random>

#include <gtest/gtest.h>

namespace revisit {
namespace {

// 400 m out and back on a level road, by an odometry that pitches up by 0.0025 degrees a metre.
struct PitchingDrive {
  PoseGraph graph;
  std::vector<Pose> truth;
  std::vector<PoseEdge> pending;

  PitchingDrive() {
    Pose T_first = Pose::Identity();
    T_first.rotate(Eigen::AngleAxisd(0.1, Eigen::Vector3d(1.0, 1.0, 0.0).normalized()));  // the sensor is tilted
    Pose T_true = T_first, T_odom = Pose::Identity();
    Matrix6 information = Matrix6::Identity();
    information.diagonal() << 1e4, 1e4, 1e4, 8e6, 8e6, 8e6;
    for (std::size_t i = 0; i < 400; ++i) {
      truth.push_back(T_true);
      graph.add_node(T_odom);
      // Steps are level in the world, in the sensor's frame they are not.
      Pose on_road = Pose::Identity();
      on_road.translate(Eigen::Vector3d(2.0, 0.0, 0.0));
      on_road.rotate(Eigen::AngleAxisd(i >= 200 && i < 220 ? kPi / 20 : 0.0, Eigen::Vector3d::UnitZ()));
      const Pose step = T_first.inverse() * on_road * T_first;
      Pose drift = Pose::Identity();
      drift.rotate(Eigen::AngleAxisd(-to_radians(0.005), Eigen::Vector3d::UnitY()));
      const Pose measured = step * drift;
      T_true = T_true * step;
      T_odom = T_odom * measured;
      if (i + 1 < 400) pending.push_back({i, i + 1, measured, information});
    }
    for (const PoseEdge& edge : pending) graph.add_edge(edge);
  }
  std::vector<UpReading> readings(const Eigen::Vector3d& off, int wrong = 0, std::size_t every = 10) const {
    std::vector<UpReading> all;
    for (std::size_t i = 0; i < truth.size(); i += every) {
      Eigen::Vector3d up = truth[i].linear().transpose() * Eigen::Vector3d::UnitZ() + off;
      if (static_cast<int>(all.size()) % 10 < wrong) up += Eigen::Vector3d(0.2, 0.1, 0.0);
      all.push_back({i, up.normalized(), 0});
    }
    return all;
  }
  // Heights that are off, once the first pose is where it is.
  double worst_m() const {
    double worst = 0.0;
    const Pose T_world_odom = truth[0] * graph.nodes()[0].inverse();
    for (std::size_t i = 0; i < truth.size(); ++i)
      worst =
          std::max(worst, std::abs((T_world_odom * graph.nodes()[i]).translation().z() - truth[i].translation().z()));
    return worst;
  }
};

TEST(Gravity, TakesDriftOutOfHeight) {
  PitchingDrive drive;
  const double before_m = drive.worst_m();
  ASSERT_GT(before_m, 2.0);
  drive.graph.set_ups(drive.readings(Eigen::Vector3d::Zero()));
  ASSERT_TRUE(drive.graph.optimise());
  EXPECT_LT(drive.worst_m(), 0.3 * before_m);
}

TEST(Gravity, AnAccelerometersOwnErrorBendsNothing) {
  PitchingDrive drive;
  const double before_m = drive.worst_m();
  drive.graph.set_ups(drive.readings({0.02, -0.01, 0.0}));
  ASSERT_TRUE(drive.graph.optimise());
  EXPECT_LT(drive.worst_m(), 0.3 * before_m);
}

// A robot turns round, which makes what its accelerometer is off known, and pitches as it does. Ten degrees are more
// than any accelerometer is off, and more likely the graph's, whose edge there may be off by five.
TEST(Gravity, NoAccelerometerIsOffByTenDegrees) {
  PoseGraph graph;
  std::vector<UpReading> readings;
  const double off_rad = to_radians(10.0);
  for (std::size_t i = 0; i < 10; ++i) {
    graph.add_node(planar_pose(0, 0, i < 5 ? 0.0 : kPi));
    PoseEdge edge{i - 1, i, planar_pose(0, 0, i == 5 ? kPi : 0.0), 1e6 * Matrix6::Identity()};
    if (i == 5) edge.information.diagonal().tail<3>().setConstant(std::pow(to_radians(5.0), -2));
    if (i > 0) graph.add_edge(edge);
    readings.push_back({i, Eigen::Vector3d(std::sin(off_rad), 0.0, std::cos(off_rad))});
  }
  graph.set_ups(std::move(readings));
  ASSERT_TRUE(graph.optimise());
  const double leans = graph.nodes()[0].linear().col(2).dot(graph.nodes()[9].linear().col(2));
  EXPECT_GT(to_degrees(std::acos(leans)), 12.0);
}

TEST(Gravity, WrongReadingsLoseTheirWeight) {
  PitchingDrive drive;
  const double before_m = drive.worst_m();
  drive.graph.set_ups(drive.readings(Eigen::Vector3d::Zero(), 1));
  const auto report = drive.graph.optimise();
  ASSERT_TRUE(report);
  EXPECT_EQ(report->ups_refused, 4u);
  EXPECT_LT(drive.worst_m(), 0.4 * before_m);
}

// Readings with noise of 0.3 degrees, along a drive whose pitch drifts evenly by so much from one to the next, in each
// half anew if it turns back. An edge across a gap, which knows next to nothing, is no step.
double deviation_deg(std::size_t count, double drift_deg, double step_between_halves_deg, unsigned seed,
                     bool turns_back = false, double edges_deg = 0.05) {
  PoseGraph graph;
  std::vector<UpReading> readings;
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0.0, to_radians(0.3));
  Matrix6 information = Matrix6::Identity();
  information.diagonal().tail<3>().setConstant(std::pow(to_radians(edges_deg), -2));
  for (std::size_t i = 0; i < count; ++i) {
    const bool is_second = step_between_halves_deg > 0.0 && i >= count / 2;
    Pose T = Pose::Identity();
    const auto drifted = static_cast<double>(turns_back ? i % (count / 2) : i);
    T.rotate(Eigen::AngleAxisd(to_radians(drift_deg * drifted + (is_second ? step_between_halves_deg : 0.0)),
                               Eigen::Vector3d::UnitY()));
    graph.add_node(T);
    if (i > 0) graph.add_edge({i - 1, i, Pose::Identity(), information});
    readings.push_back({i, Eigen::Vector3d(noise(random), noise(random), 1.0).normalized(), 0, is_second ? 1 : 0});
  }
  graph.add_edge({0, count / 2, Pose::Identity(), 1e-6 * information});
  weigh_ups(graph, readings);
  return to_degrees(readings[0].deviation_rad);
}

TEST(Gravity, NoiseIsToldFromEvenDrift) {
  for (const std::size_t count : {40u, 200u, 400u})
    for (const double drift_deg : {0.1, 0.2}) {
      const double deviation = deviation_deg(count, drift_deg, 0.0, 3);
      EXPECT_GT(deviation, 0.2) << count << " " << drift_deg;
      EXPECT_LT(deviation, 0.6) << count << " " << drift_deg;
    }
}

TEST(Gravity, ADriftThatComesBackIsSeenByQuarters) {
  const double deviation = deviation_deg(400, 0.1, 0.0, 3, true);
  EXPECT_GT(deviation, 0.2);
  EXPECT_LT(deviation, 0.6);
}

// Where edges say that the graph drifts by more than it does, readings count for less by as much.
TEST(Gravity, CountsLessWhereTheGraphDriftsLessThanItsEdgesSay) {
  const double as_said = deviation_deg(400, 0.1, 0.0, 3), more_is_said = deviation_deg(400, 0.1, 0.0, 3, false, 5.0);
  EXPECT_NEAR(as_said, 0.3, 0.06) << "the noise that was put in";
  // Over 200 edges 5,000 square degrees are said, and 20 degrees drifted, whose square is 1.386 variances.
  EXPECT_NEAR(more_is_said, 0.3 * std::sqrt(5000.0 / (400.0 / 1.386)), 0.25);
}

// Where it drifts by little more than the readings vary, the readings' part in that is not the graph's: over half of
// the way, 1 degree in one of two coordinates, beside twice the noise in both.
TEST(Gravity, WhatReadingsVaryIsNoDriftOfTheGraph) {
  double mean = 0.0;
  for (unsigned seed = 0; seed < 20; ++seed) mean += deviation_deg(400, 1.0 / 200.0, 0.0, seed, false, 0.5) / 20.0;
  EXPECT_NEAR(mean, 0.3 * std::sqrt(50.0 / 0.7), 0.2);
}

TEST(Gravity, ThirtyTwoReadingsAreEnoughToShowALargeDrift) {
  EXPECT_LT(deviation_deg(32, 0.5, 0.0, 3), 1.0);
  EXPECT_NEAR(deviation_deg(31, 0.5, 0.0, 3), 10.0, 1e-9);
}

TEST(Gravity, PartsThatLieTiltedToEachOtherDoNotDrift) { EXPECT_GT(deviation_deg(120, 0.0, 4.0, 4), 3.0); }

TEST(Gravity, FewReadingsRarelyShowDriftWhereThereIsNone) {
  int trusted = 0;
  for (unsigned seed = 0; seed < 100; ++seed) trusted += deviation_deg(36, 0.0, 0.0, seed) < 2.0;
  EXPECT_LE(trusted, 5);
}

// Readings that are off by half a degree each, of a graph that drifts, and of one that does not, where a tenth may be
// wrong.
TEST(Gravity, CountsWhereTheGraphDriftsMoreThanTheReadingsVary) {
  for (const auto& [drifts, wrong] : {std::pair{true, 0}, {false, 0}, {false, 1}}) {
    PitchingDrive drive;
    if (!drifts)
      for (std::size_t i = 0; i < drive.truth.size(); ++i)
        drive.graph.move_node(i, drive.truth[0].inverse() * drive.truth[i]);
    std::mt19937 random(7);
    std::normal_distribution<double> noise(0.0, to_radians(0.3));
    auto readings = drive.readings(Eigen::Vector3d(0.01, 0.0, 0.0), wrong, 2);
    for (UpReading& each : readings)
      each.up = (each.up + Eigen::Vector3d(noise(random), noise(random), 0.0)).normalized();
    weigh_ups(drive.graph, readings);
    const double deviation_deg = to_degrees(readings[0].deviation_rad);
    if (drifts) {
      EXPECT_GT(deviation_deg, 0.15);
      EXPECT_LT(deviation_deg, 1.0);
    } else {
      EXPECT_GT(deviation_deg, 5.0);
    }
  }
}

// An accelerometer that is off by 3 degrees, on a robot that turns round after seven tenths of its way: as seen in the
// world its error turns, too, and the mean of up leans by it. The graph is exact.
TEST(Gravity, AnAccelerometersOwnErrorIsNoDriftOfTheGraph) {
  PoseGraph graph;
  std::vector<UpReading> readings;
  std::mt19937 random(11);
  std::normal_distribution<double> noise(0.0, to_radians(0.3));
  Matrix6 information = Matrix6::Identity();
  information.diagonal().tail<3>().setConstant(std::pow(to_radians(0.05), -2));
  for (std::size_t i = 0; i < 200; ++i) {
    graph.add_node(planar_pose(0, 0, i < 140 ? 0.0 : kPi));
    if (i > 0) graph.add_edge({i - 1, i, Pose::Identity(), information});
    readings.push_back({i, Eigen::Vector3d(0.05 + noise(random), noise(random), 1.0).normalized(), 0});
  }
  weigh_ups(graph, readings);
  EXPECT_GT(to_degrees(readings[0].deviation_rad), 5.0);
}

}  // namespace
}  // namespace revisit
