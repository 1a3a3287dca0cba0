// SPDX-License-Identifier: Apache-2.0
// One more loop in a graph of key frames that agreed until then. Argument: key frames.
#include <benchmark/benchmark.h>

#include <cmath>
#include <random>

#include <revisit/pose_graph/pose_graph.hpp>

namespace {

using namespace revisit;

// Rounds of 500 key frames through streets in a ring of 1 km; the odometry drifts, and every tenth key frame finds the
// round before.
PoseGraph rounds(std::size_t nodes, bool with_loops) {
  constexpr std::size_t kRound = 500;
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  std::vector<Pose> truth;
  for (std::size_t i = 0; i < nodes; ++i) {
    const double angle = 2.0 * kPi * static_cast<double>(i) / kRound;
    truth.push_back(planar_pose(160.0 * std::sin(angle), 160.0 - 160.0 * std::cos(angle), angle));
  }
  const auto measured = [&](std::size_t from, std::size_t to) {
    constexpr double kMetres = 0.02, kRadians = 0.0005;
    Vector6 xi;
    for (Eigen::Index k = 0; k < 6; ++k) xi[k] = normal(random) * (k < 3 ? kMetres : kRadians);
    PoseEdge edge{from, to, truth[from].inverse() * truth[to] * small_motion(xi)};
    edge.information.diagonal() << Eigen::Vector3d::Constant(1.0 / (kMetres * kMetres)),
        Eigen::Vector3d::Constant(1.0 / (kRadians * kRadians));
    edge.is_loop = to != from + 1;
    return edge;
  };
  PoseGraph graph;
  graph.add_node(truth[0]);
  for (std::size_t i = 1; i < nodes; ++i) {
    const PoseEdge edge = measured(i - 1, i);
    graph.add_node(graph.nodes().back() * edge.T_from_to);
    graph.add_edge(edge);
  }
  for (std::size_t i = kRound; with_loops && i < nodes; i += 10) graph.add_edge(measured(i - kRound, i));
  return graph;
}

void one_more_loop(benchmark::State& state) {
  PoseGraph graph = rounds(static_cast<std::size_t>(state.range(0)), true);
  if (!graph.optimise()) return state.SkipWithError("no solution");
  const PoseGraph::Report none;
  int iterations = none.iterations;
  for (auto _ : state) {
    state.PauseTiming();
    PoseGraph more = graph;
    const std::size_t last = more.nodes().size() - 5;
    PoseEdge edge{last - 500, last, more.nodes()[last - 500].inverse() * more.nodes()[last]};
    edge.T_from_to.translation().x() += 0.05;
    edge.information *= 1000.0;
    edge.is_loop = true;
    more.add_edge(edge);
    state.ResumeTiming();
    const auto report = more.optimise(PoseGraph::kOnline);
    if (!report) return state.SkipWithError(report.error().message.c_str());
    iterations = report->iterations;
  }
  state.counters["iterations"] = iterations;
}
BENCHMARK(one_more_loop)->Arg(1000)->Arg(5000)->Arg(50000)->Unit(benchmark::kMillisecond)->UseRealTime();

}  // namespace

BENCHMARK_MAIN();
