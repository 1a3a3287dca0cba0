// SPDX-License-Identifier: Apache-2.0
#include <revisit/pose_graph/pose_graph.hpp>

#include <cmath>
#include <fstream>
#include <map>
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
  rounds.graph.move_node(0, rounds.truth[0] * planar_pose(0.01, 0.02, 0.001));
  const Pose first = rounds.graph.nodes()[0];
  const auto report = rounds.graph.optimise();
  ASSERT_TRUE(report) << report.error().message;
  EXPECT_LT(rounds.rmse_m(), 0.5 * before_m);
  EXPECT_LT(report->cost_after, report->cost_before);
  EXPECT_EQ(report->loops_refused, 0u);
  EXPECT_TRUE(rounds.graph.nodes()[0].isApprox(first, 1e-12)) << "the first stays where it is";
}

TEST(PoseGraph, ThirtyPercentWrongLoopsDoNotBendIt) {
  Rounds right, mixed;
  right.add_right_loops();
  mixed.add_wrong_loops(9);  // of 29
  mixed.add_right_loops();
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

TEST(PoseGraph, WhatWasRefusedIsNotTriedAgain) {
  Rounds rounds;
  rounds.add_right_loops();
  rounds.add_wrong_loops(9);
  const auto first = rounds.graph.optimise();
  const auto again = rounds.graph.optimise();
  ASSERT_TRUE(first && again);
  EXPECT_EQ(again->loops_refused, 9u);
  EXPECT_LE(again->iterations, 6) << "of " << first->iterations << " the first time";
}

TEST(PoseGraph, TwoNodesAreMovedToo) {
  PoseGraph graph;
  graph.add_node(Pose::Identity());
  graph.add_node(Pose::Identity());
  graph.add_edge({0, 1, planar_pose(3.0, 1.0, 0.5)});
  ASSERT_TRUE(graph.optimise());
  EXPECT_TRUE(graph.nodes()[1].isApprox(planar_pose(3.0, 1.0, 0.5), 1e-6));
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

TEST(PoseGraph, ForeignFilesAreReadAndWrongEdgesRefused) {
  const auto file = std::filesystem::temp_directory_path() / ("revisit_edges_" + std::to_string(::getpid()) + ".g2o");
  const auto read = [&](const std::string& text) {
    std::ofstream(file) << text;
    return PoseGraph::read_g2o(file);
  };
  const std::string head =
                        "# a comment\n\nVERTEX_SE3:QUAT 7 0 0 0 0 0 0 1\nVERTEX_SE3:QUAT 3 1 2 3 0 0 0.002 1\nFIX 7\n",
                    motion = " 1 2 3 0 0 0 1", numbers = " 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20 21\n";
  const auto graph = read(head + "EDGE_SE3:QUAT 7 3" + motion + numbers + "EDGE_SE3:QUAT 3 7" + motion + numbers);
  ASSERT_TRUE(graph) << graph.error().message;
  ASSERT_EQ(graph->nodes().size(), 2u);
  EXPECT_NEAR(graph->nodes()[1].linear().determinant(), 1.0, 1e-12) << "a quaternion that was rounded";
  const PoseEdge& edge = graph->edges()[0];
  EXPECT_EQ(edge.to, edge.from + 1) << "numbers of vertices need not follow each other";
  EXPECT_FALSE(edge.is_loop);
  EXPECT_TRUE(graph->edges()[1].is_loop);
  EXPECT_DOUBLE_EQ(edge.information(0, 5), 6.0 / 2.0) << "g2o counts half a rotation";
  EXPECT_DOUBLE_EQ(edge.information(5, 0), 6.0 / 2.0);
  EXPECT_DOUBLE_EQ(edge.information(1, 1), 7.0);
  EXPECT_DOUBLE_EQ(edge.information(5, 5), 21.0 / 4.0);
  for (const auto& [line, why] : std::map<std::string, std::string>{
           {"EDGE_SE3:QUAT 7 7" + motion + numbers, ":6: leads from vertex 7 to 7; allowed: two different ones"},
           {"EDGE_SE3:QUAT 7 4" + motion + numbers, ":6: leads from vertex 7 to 4"},
           {"EDGE_SE3:QUAT 4 7" + motion + numbers, ":6: leads from vertex 4 to 7"},
           {"EDGE_SE3:QUAT 7" + motion + "\n", ":6: is no edge"},
           {"EDGE_SE3:QUAT x 3" + motion + numbers, ":6: is no edge"},
           {"EDGE_SE3:QUAT 7 3 1 2 3 0 0 0 0.9" + numbers, ":6: is no edge"}}) {
    const auto refused = read(head + line);
    ASSERT_FALSE(refused) << line;
    EXPECT_NE(refused.error().message.find(why), std::string::npos) << refused.error().message;
  }
  std::filesystem::remove(file);
  EXPECT_NE(PoseGraph::read_g2o(file).error().message.find("cannot be opened"), std::string::npos);
  EXPECT_FALSE(graph->write_g2o(file / "no such folder"));
}

TEST(PoseGraph, AnErrorIsMeasuredFromWhereTheEdgeEnds) {
  PoseEdge edge;
  edge.T_from_to = planar_pose(2, 0, kPi / 2);
  edge.information.diagonal() << 1, 10, 100, 1000, 10000, 100000;
  const Pose T_world_from = planar_pose(5, -3, 0.4);
  EXPECT_NEAR(squared_error(edge, T_world_from, T_world_from * edge.T_from_to), 0.0, 1e-12);
  EXPECT_NEAR(squared_error(edge, T_world_from, T_world_from * planar_pose(2.1, 0, kPi / 2)), 10 * 0.01, 1e-9)
      << "ahead at its beginning is to the side at its end";
  EXPECT_NEAR(squared_error(edge, T_world_from, T_world_from * planar_pose(2, 0, kPi / 2 + 0.01)), 1e5 * 1e-4, 1e-9);
}

TEST(PoseGraph, ReadingsOfGravityThatCannotBeAreRefused) {
  PoseGraph graph;
  graph.add_node(Pose::Identity());
  const UpReading right;
  EXPECT_NO_THROW(graph.set_ups({right}));
  const auto refuses = [&](auto change) {
    UpReading wrong = right;
    change(wrong);
    EXPECT_THROW(graph.set_ups({right, wrong}), std::invalid_argument);
  };
  refuses([](UpReading& each) { each.node = 1; });
  refuses([](UpReading& each) { each.sensor = -1; });
  refuses([](UpReading& each) { each.part = -1; });
  refuses([](UpReading& each) { each.deviation_rad = 0.0; });
  refuses([](UpReading& each) { each.deviation_rad = std::nan(""); });
  refuses([](UpReading& each) { each.up *= 1.1; });
  refuses([](UpReading& each) { each.up *= 0.9; });
}

// One loop is bent by the odometry around it: believed in full up to a squared error of 22, not at all beyond.
TEST(PoseGraph, ALoopIsBelievedOrRefusedAsAWhole) {
  const auto weight_at = [](double off_deviations) {
    PoseGraph graph;
    for (int i = 0; i < 3; ++i) graph.add_node(planar_pose(i, 0, 0));
    for (std::size_t i = 0; i < 2; ++i) graph.add_edge({i, i + 1, planar_pose(1, 0, 0), 1e10 * Matrix6::Identity()});
    graph.add_edge({0, 2, planar_pose(2.0 + 0.1 * off_deviations, 0, 0), 100.0 * Matrix6::Identity(), true});
    EXPECT_TRUE(graph.optimise());
    return graph.edges().back().weight;
  };
  EXPECT_EQ(weight_at(4.7), 1.0);
  EXPECT_EQ(weight_at(4.8), 0.0);
}

// Nor do others that were refused, nor readings of gravity that contradict one another, cast doubt on a loop that the
// graph bends to: tried again, it would be refused as the dearer one.
TEST(PoseGraph, ALoopIsBelievedBesideWhatIsRefused) {
  for (const bool other_was_refused : {false, true}) {
    PoseGraph graph;
    for (int i = 0; i < 3; ++i) graph.add_node(planar_pose(i, 0, 0));
    for (std::size_t i = 0; i < 2; ++i) graph.add_edge({i, i + 1, planar_pose(1, 0, 0), 100.0 * Matrix6::Identity()});
    graph.add_edge({0, 2, planar_pose(2.0 + 1.35, 0, 0), 100.0 * Matrix6::Identity(), true});
    if (other_was_refused) graph.add_edge({0, 2, planar_pose(40, 0, 0), 100.0 * Matrix6::Identity(), true, 0.0});
    const Eigen::Vector3d leaning(std::sin(0.4), 0.0, std::cos(0.4));
    graph.set_ups({{0}, {1}, {2}, {1, leaning}});
    const auto report = graph.optimise();
    ASSERT_TRUE(report) << report.error().message;
    EXPECT_EQ(report->ups_refused, 1u);
    EXPECT_EQ(graph.edges()[2].weight, 1.0) << other_was_refused;
  }
}

TEST(PoseGraph, EdgesThatCannotBeAreRefused) {
  PoseGraph graph;
  EXPECT_TRUE(graph.optimise()) << "nothing to do";
  graph.add_node(Pose::Identity());
  PoseEdge edge;
  EXPECT_THROW(graph.add_edge(edge), std::invalid_argument);
  graph.add_node(planar_pose(1, 0, 0));
  edge.to = 1;
  EXPECT_NO_THROW(graph.add_edge(edge));
  PoseEdge wrong = edge;
  wrong.information(0, 0) = std::nan("");
  EXPECT_THROW(graph.add_edge(wrong), std::invalid_argument);
  wrong = edge;
  wrong.information(0, 1) = 0.5;
  EXPECT_THROW(graph.add_edge(wrong), std::invalid_argument) << "not symmetric";
  wrong = edge;
  wrong.T_from_to.translation().x() = std::nan("");
  EXPECT_THROW(graph.add_edge(wrong), std::invalid_argument);
  for (const auto& [from, to] : {std::pair{0u, 2u}, {2u, 0u}, {1u, 1u}}) {
    wrong = edge;
    wrong.from = from;
    wrong.to = to;
    EXPECT_THROW(graph.add_edge(wrong), std::invalid_argument);
  }
}

}  // namespace
}  // namespace revisit
