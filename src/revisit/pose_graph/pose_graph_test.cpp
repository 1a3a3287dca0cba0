// SPDX-License-Identifier: Apache-2.0
#include <revisit/pose_graph/pose_graph.hpp>

#include <cmath>
#include <fstream>
#include <random>
#include <stdexcept>

#include <unistd.h>

#include <gtest/gtest.h>

namespace revisit {
namespace {

// Three rounds of a circle of 100 m, driven with an odometry that drifts, and loops from each round to the one before.
struct Rounds {
  static constexpr std::size_t kRound = 100, kNodes = 3 * kRound;
  std::vector<Pose> truth;
  PoseGraph graph;
  std::mt19937 random{7};

  Rounds() {
    for (std::size_t i = 0; i < kNodes; ++i) {
      const double angle = 2.0 * kPi * static_cast<double>(i) / kRound;
      truth.push_back(planar_pose(16.0 * std::sin(angle), 16.0 - 16.0 * std::cos(angle), angle));
    }
    graph.add_node(truth[0]);
    for (std::size_t i = 1; i < kNodes; ++i) {
      const PoseEdge edge = measured(i - 1, i, 0.02, 0.002);
      graph.add_node(graph.nodes().back() * edge.T_from_to);
      graph.add_edge(edge);
    }
  }
  Pose noise(double metres, double radians) {
    std::normal_distribution<double> normal;
    Vector6 xi;
    for (Eigen::Index k = 0; k < 6; ++k) xi[k] = normal(random) * (k < 3 ? metres : radians);
    return small_motion(xi);
  }
  PoseEdge measured(std::size_t from, std::size_t to, double metres, double radians) {
    PoseEdge edge;
    edge.from = from;
    edge.to = to;
    edge.T_from_to = truth[from].inverse() * truth[to] * noise(metres, radians);
    edge.information.diagonal() << Eigen::Vector3d::Constant(1.0 / (metres * metres)),
        Eigen::Vector3d::Constant(1.0 / (radians * radians));
    edge.is_loop = to != from + 1;
    return edge;
  }
  void add_right_loops() {
    for (std::size_t i = kRound; i < kNodes; i += 10) graph.add_edge(measured(i - kRound, i, 0.02, 0.002));
  }
  // Into the middle of nowhere, in groups that agree with one another.
  void add_wrong_loops(std::size_t count) {
    for (std::size_t k = 0; k < count; ++k) {
      PoseEdge edge = measured(5 + 7 * k % 80, 150 + 11 * k % 140, 0.02, 0.002);
      edge.T_from_to = noise(0.5, 0.05);
      graph.add_edge(edge);
    }
  }
  double rmse_m() const {
    double sum = 0.0;
    for (std::size_t i = 0; i < truth.size(); ++i)
      sum += (graph.nodes()[i].translation() - truth[i].translation()).squaredNorm();
    return std::sqrt(sum / static_cast<double>(truth.size()));
  }
};

TEST(PoseGraph, LoopsTakeTheDriftAway) {
  Rounds rounds;
  const double before_m = rounds.rmse_m();
  rounds.add_right_loops();
  const auto report = rounds.graph.optimise();
  ASSERT_TRUE(report) << report.error().message;
  EXPECT_LT(rounds.rmse_m(), 0.5 * before_m);
  EXPECT_LT(report->cost_after, report->cost_before);
  EXPECT_EQ(report->loops_refused, 0u);
}

TEST(PoseGraph, ThirtyPercentWrongLoopsDoNotBendIt) {
  Rounds right, mixed;
  right.add_right_loops();
  mixed.add_right_loops();
  mixed.add_wrong_loops(9);  // of 29
  ASSERT_TRUE(right.graph.optimise());
  const auto report = mixed.graph.optimise();
  ASSERT_TRUE(report) << report.error().message;
  EXPECT_EQ(report->loops_refused, 9u);
  EXPECT_NEAR(mixed.rmse_m(), right.rmse_m(), 0.01);
  for (const PoseEdge& edge : mixed.graph.edges())
    if (edge.is_loop) {
      EXPECT_EQ(edge.weight > 0.5, edge.to == edge.from + Rounds::kRound);
    }
}

TEST(PoseGraph, OneMoreLoopStartsFromWhereItWas) {
  Rounds rounds;
  rounds.add_right_loops();
  ASSERT_TRUE(rounds.graph.optimise());
  rounds.graph.add_edge(rounds.measured(95, 195, 0.02, 0.002));
  const auto again = rounds.graph.optimise();
  ASSERT_TRUE(again);
  EXPECT_LE(again->iterations, 6);
}

TEST(PoseGraph, WrittenAndReadAgainItIsTheSame) {
  Rounds rounds;
  rounds.add_right_loops();
  const auto file = std::filesystem::temp_directory_path() / ("revisit_graph_" + std::to_string(::getpid()) + ".g2o");
  ASSERT_TRUE(rounds.graph.write_g2o(file));
  const auto read = PoseGraph::read_g2o(file);
  ASSERT_TRUE(read) << read.error().message;
  ASSERT_EQ(read->nodes().size(), rounds.graph.nodes().size());
  ASSERT_EQ(read->edges().size(), rounds.graph.edges().size());
  EXPECT_TRUE(read->nodes()[120].isApprox(rounds.graph.nodes()[120], 1e-9));
  const PoseEdge &a = read->edges().back(), &b = rounds.graph.edges().back();
  EXPECT_TRUE(a.T_from_to.isApprox(b.T_from_to, 1e-9));
  EXPECT_TRUE(a.information.isApprox(b.information, 1e-9));
  EXPECT_TRUE(a.is_loop);
  std::filesystem::remove(file);
}

TEST(PoseGraph, BrokenFilesAreRefusedByLine) {
  const auto file = std::filesystem::temp_directory_path() / ("revisit_broken_" + std::to_string(::getpid()) + ".g2o");
  const auto message = [&](const std::string& text) {
    std::ofstream(file) << text;
    const auto read = PoseGraph::read_g2o(file);
    return read ? std::string() : read.error().message;
  };
  const std::string vertex = "VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1\n";
  EXPECT_NE(message("").find("holds no vertex"), std::string::npos);
  EXPECT_NE(message(vertex + vertex).find(":2: vertex 0 comes twice"), std::string::npos);
  EXPECT_NE(message(vertex + "EDGE_SE3:QUAT 0 7 0 0 0 0 0 0 1 1 2").find(":2: has fewer than 21"), std::string::npos);
  EXPECT_NE(message(vertex + "VERTEX_SE3:QUAT 1 0 0 0 0 0 0 9\n").find(":2: is no vertex"), std::string::npos);
  EXPECT_NE(message(vertex + "VERTEX_SE2 1 0 0 0\n").find("'VERTEX_SE2' is not known"), std::string::npos);
  std::filesystem::remove(file);
}

TEST(PoseGraph, EdgesThatCannotBeAreRefused) {
  PoseGraph graph;
  EXPECT_TRUE(graph.optimise()) << "nothing to do";
  graph.add_node(Pose::Identity());
  PoseEdge edge;
  EXPECT_THROW(graph.add_edge(edge), std::invalid_argument);
  graph.add_node(planar_pose(1, 0, 0));
  edge.to = 1;
  edge.information(0, 0) = std::nan("");
  EXPECT_THROW(graph.add_edge(edge), std::invalid_argument);
}

}  // namespace
}  // namespace revisit
