// SPDX-License-Identifier: Apache-2.0
#include <revisit/pose_graph/earth.hpp>

#include <random>

#include <gtest/gtest.h>

namespace revisit {
namespace {

Pose at(double x, double y, double yaw_rad) {
  Pose T = Pose::Identity();
  T.translate(Eigen::Vector3d(x, y, 0.0));
  T.rotate(Eigen::AngleAxisd(yaw_rad, Eigen::Vector3d::UnitZ()));
  return T;
}

// A way of 600 m with two bends, measured with an odometry whose heading drifts.
struct Drive {
  std::vector<Pose> truth;
  PoseGraph graph;
  std::vector<int> parts;

  explicit Drive(double drift_rad = 4e-4) {
    Pose T = Pose::Identity(), believed = Pose::Identity();
    Matrix6 information = Matrix6::Identity();
    information.diagonal() << 400, 400, 400, 1e5, 1e5, 1e5;
    for (int i = 0; i < 300; ++i) {
      truth.push_back(T);
      parts.push_back(0);
      graph.add_node(believed);
      const Pose step = at(2.0, 0.0, i % 100 > 80 ? 0.05 : 0.0), measured = step * at(0.0, 0.0, drift_rad);
      if (i > 0) graph.add_edge({static_cast<std::size_t>(i - 1), static_cast<std::size_t>(i), last, information});
      last = measured;
      T = T * step;
      believed = believed * measured;
    }
  }
  double worst_m(const Pose& T_truth_world) const {
    double worst = 0.0;
    for (std::size_t i = 0; i < truth.size(); ++i)
      worst = std::max(worst, (truth[i].translation() - T_truth_world * graph.nodes()[i].translation()).norm());
    return worst;
  }
  Pose last = Pose::Identity();
};

// Where the receiver is on the earth: turned, far off, with jumps.
std::vector<EarthFix> fixes(const Drive& drive, const Pose& T_earth_truth, int jumps, double times = 1.0) {
  std::mt19937 random(5);
  std::normal_distribution<double> noise(0.0, 0.5);
  std::vector<EarthFix> all;
  for (std::size_t i = 0; i < drive.truth.size(); i += 5) {
    Eigen::Vector3d p =
        T_earth_truth * drive.truth[i].translation() + Eigen::Vector3d(noise(random), noise(random), noise(random));
    if (static_cast<int>(all.size()) % 10 < jumps) p += times * Eigen::Vector3d(30.0, -20.0, 10.0);
    all.push_back({i, p, Eigen::Vector3d::Constant(0.5)});
  }
  return all;
}

TEST(Earth, FixesUndoDriftAndTellHowTheMapLies) {
  const Pose T_earth_truth = at(4000.0, -700.0, 2.0);
  for (const auto& [jumps, times] : {std::pair{0, 1.0}, {2, 1.0}, {4, 1.0}, {4, 100.0}}) {
    Drive drive;
    ASSERT_GT(drive.worst_m(Pose::Identity()), 15.0);
    const auto placed = settle_on_earth(drive.graph, fixes(drive, T_earth_truth, jumps, times), drive.parts);
    ASSERT_TRUE(placed) << placed.error().message;
    ASSERT_EQ(placed->size(), 1u);
    ASSERT_TRUE((*placed)[0]);
    EXPECT_LT(drive.worst_m(T_earth_truth.inverse() * *(*placed)[0]), 1.5)
        << jumps << " of 10 are jumps of " << 37.0 * times << " m";
  }
}

// A receiver that is somewhere else each time it is wrong, by tens of kilometres: the graph, solved from where the mean
// of all fixes has it, would stay there.
TEST(Earth, FixesThatAreAnywhereDoNotCount) {
  for (const double yaw_rad : {-2.0, 1.0, 2.0}) {
    Drive drive;
    const Pose T_earth_truth = at(4000.0, -700.0, yaw_rad);
    auto all = fixes(drive, T_earth_truth, 0);
    std::mt19937 random(9);
    std::normal_distribution<double> anywhere_m(0.0, 30e3);
    for (std::size_t i = 0; i < all.size(); ++i)
      if (i % 10 < 4) all[i].position_m += Eigen::Vector3d(anywhere_m(random), anywhere_m(random), 0.0);
    const auto placed = settle_on_earth(drive.graph, all, drive.parts);
    ASSERT_TRUE(placed) << placed.error().message;
    ASSERT_TRUE((*placed)[0]);
    EXPECT_LT(drive.worst_m(T_earth_truth.inverse() * *(*placed)[0]), 3.0) << yaw_rad;
  }
}

// A receiver that is wrong for two fifths of the way in one piece, as between high houses, and always by the same:
// these fixes agree with one another.
TEST(Earth, AStretchOfWrongFixesDoesNotCount) {
  const Pose T_earth_truth = at(4000.0, -700.0, 2.0);
  for (const double times : {1.0, 10.0, 100.0})
    for (const std::size_t first : {0, 12, 24, 36}) {
      Drive drive;
      auto all = fixes(drive, T_earth_truth, 0);
      for (std::size_t i = first; i < first + 24; ++i) all[i].position_m += times * Eigen::Vector3d(30.0, -20.0, 10.0);
      const auto placed = settle_on_earth(drive.graph, all, drive.parts);
      ASSERT_TRUE(placed) << placed.error().message;
      ASSERT_TRUE((*placed)[0]);
      // Where there is no fix, odometry alone says how the way goes: its drift over 240 m.
      EXPECT_LT(drive.worst_m(T_earth_truth.inverse() * *(*placed)[0]), 9.0) << times << " from " << first;
    }
}

// Too few, or all at one place: nothing is moved.
TEST(Earth, FewFixesPlaceNothing) {
  Drive drive;
  const std::vector<Pose> before = drive.graph.nodes();
  auto all = fixes(drive, at(0, 0, 1.0), 0);
  all.resize(3);
  const auto few = settle_on_earth(drive.graph, all, drive.parts);
  ASSERT_TRUE(few);
  EXPECT_FALSE((*few)[0]);
  for (std::size_t i = 0; i < before.size(); ++i)
    EXPECT_LT((before[i].translation() - drive.graph.nodes()[i].translation()).norm(), 0.01);
  auto vague = fixes(drive, at(0, 0, 1.0), 0);
  for (EarthFix& fix : vague) fix.deviation_m.setConstant(200.0);
  const auto by_vague = settle_on_earth(drive.graph, vague, drive.parts);
  ASSERT_TRUE(by_vague);
  EXPECT_FALSE((*by_vague)[0]) << "the way spreads by less than four of what they are off";
  std::vector<EarthFix> together;
  for (std::size_t i = 0; i < 5; ++i) together.push_back({0, Eigen::Vector3d(0.1, 0.2, 0.0), Eigen::Vector3d::Ones()});
  const auto placed = settle_on_earth(drive.graph, together, drive.parts);
  ASSERT_TRUE(placed);
  EXPECT_FALSE((*placed)[0]);
}

// A straight way, whose fixes tell its heading and not how it leans.
TEST(Earth, AMapWithoutKeyFramesHasNoPart) {
  PoseGraph graph;
  const auto placed = settle_on_earth(graph, {}, {});
  ASSERT_TRUE(placed);
  EXPECT_TRUE(placed->empty());
}

TEST(Earth, AStraightWayStaysUpright) {
  for (const double yaw_rad : {0.5, -2.0}) {
    Drive drive(0.0);
    drive.parts.resize(80);
    drive.truth.resize(80);
    PoseGraph straight;
    for (std::size_t i = 0; i < 80; ++i) straight.add_node(at(0, 0, 0.7) * drive.graph.nodes()[i]);
    for (std::size_t i = 0; i + 1 < 80; ++i) straight.add_edge(drive.graph.edges()[i]);
    const Pose T_earth_truth = at(300.0, 50.0, yaw_rad);
    const auto placed = settle_on_earth(straight, fixes(drive, T_earth_truth, 0), drive.parts);
    ASSERT_TRUE(placed) << placed.error().message;
    ASSERT_TRUE((*placed)[0]);
    const Pose error = T_earth_truth.inverse() * *(*placed)[0] * straight.nodes()[0];
    EXPECT_LT(error.translation().norm(), 0.5);
    EXPECT_LT(to_degrees(rotation_angle(error)), 1.0);
  }
}

// Parts that nothing joins lie on the earth each by its own fixes.
TEST(Earth, PartsArePlacedEachByItsOwnFixes) {
  Drive drive(0.0);
  for (std::size_t i = 150; i < 300; ++i) drive.parts[i] = 1;
  const auto placed = settle_on_earth(drive.graph, fixes(drive, at(50.0, 0.0, 0.5), 0), drive.parts);
  ASSERT_TRUE(placed);
  ASSERT_TRUE((*placed)[0] && (*placed)[1]);
  EXPECT_NEAR(yaw_of(*(*placed)[0]), 0.5, 0.02);
  EXPECT_NEAR(yaw_of(*(*placed)[1]), 0.5, 0.02);
}

// What is returned goes with the nodes as they are settled, not with where they were: far from its own start, too,
// where the drift is a multiple of what fixes are off by; and a part without fixes does not keep later ones from it.
TEST(Earth, ALaterPartIsSettledAsTheFirstIs) {
  const Pose T_earth_truth = at(4000.0, -700.0, 2.0);
  for (const bool first_has_fixes : {true, false}) {
    Drive drive;
    for (std::size_t i = 100; i < 300; ++i) drive.parts[i] = 1;
    auto all = fixes(drive, T_earth_truth, 0);
    if (!first_has_fixes) std::erase_if(all, [](const EarthFix& fix) { return fix.node < 100; });
    const auto placed = settle_on_earth(drive.graph, all, drive.parts);
    ASSERT_TRUE(placed);
    EXPECT_EQ((*placed)[0].has_value(), first_has_fixes);
    ASSERT_TRUE((*placed)[1]);
    for (std::size_t i = 100; i < 300; ++i)
      EXPECT_LT(
          (*(*placed)[1] * drive.graph.nodes()[i].translation() - T_earth_truth * drive.truth[i].translation()).norm(),
          1.5);
  }
}

}  // namespace
}  // namespace revisit
