// SPDX-License-Identifier: Apache-2.0
#include <revisit/pose_graph/gravity.hpp>

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>
#include <vector>

#include <Eigen/LU>

#include <revisit/pose_graph/internal/median.hpp>

namespace revisit {
namespace {

using pose_graph_internal::median;

struct Weighing {
  static constexpr int kRounds = 20;  ///< until both settle: where up is, and how much the sensor is off
  static constexpr std::size_t kFewest = 32;
  /// Distant readings must differ by so much more than noise, in deviations of what few of them show, if it drifts.
  static constexpr double kShows = 6.0;
  static constexpr double kLeast_deg = 0.05, kMost_deg = 10.0;
  static constexpr double kMedianOfSquares = 1.386;  ///< of two coordinates, in variances (chi-square)
};

using Vectors = std::vector<Eigen::Vector3d>;

// How far readings of one sensor are from what they have in common, in the world. Those that are far off count little.
Vectors errors_of(const PoseGraph& graph, const std::vector<const UpReading*>& readings) {
  struct Weighed {
    Eigen::Matrix3d R_world_node;
    Eigen::Vector3d up, error;
    double weight = 1.0;
  };
  std::vector<Weighed> all;
  all.reserve(readings.size());
  for (const UpReading* reading : readings)
    all.push_back({graph.nodes()[reading->node].linear(), reading->up, Eigen::Vector3d::Zero()});
  Eigen::Vector3d off = Eigen::Vector3d::Zero();
  for (int round = 0; round < Weighing::kRounds; ++round) {
    Eigen::Vector3d up = Eigen::Vector3d::Zero(), more_off = Eigen::Vector3d::Zero();
    double sum = 0.0;
    for (const Weighed& each : all) up += each.weight * (each.R_world_node * (each.up - off));
    up.normalize();
    std::vector<double> sizes;
    for (Weighed& each : all) {
      each.error = each.R_world_node * (each.up - off) - up;
      more_off += each.weight * (each.R_world_node.transpose() * each.error);
      sum += each.weight;
      sizes.push_back(each.error.norm());
    }
    off += more_off / sum;
    const double usual = std::max(to_radians(Weighing::kLeast_deg), median(std::move(sizes)));
    for (Weighed& each : all) each.weight = 1.0 / std::pow(1.0 + std::pow(each.error.norm() / (2.0 * usual), 2), 2);
  }
  Vectors errors;
  errors.reserve(all.size());
  for (const Weighed& each : all) errors.push_back(each.error);
  return errors;
}

// Of one coordinate of these vectors, most of which are noise.
double variance_of(const Vectors& vectors) {
  std::vector<double> squares;
  squares.reserve(vectors.size());
  for (const Eigen::Vector3d& each : vectors) squares.push_back(each.squaredNorm());
  return median(std::move(squares)) / Weighing::kMedianOfSquares;
}

// How much errors that lie `lag` readings apart differ.
double variance_at(const Vectors& errors, std::size_t lag) {
  Vectors differences;
  for (std::size_t i = lag; i < errors.size(); ++i) differences.push_back(errors[i] - errors[i - lag]);
  return variance_of(differences);
}

// How much a reading is off from its neighbours' middle: drift, which is even over three of them, falls out.
double noise_of(const Vectors& errors) {
  constexpr double kVariances = 1.0 + 4.0 + 1.0;
  Vectors second_differences;
  for (std::size_t i = 2; i < errors.size(); ++i)
    second_differences.push_back(errors[i] - 2.0 * errors[i - 1] + errors[i - 2]);
  return variance_of(second_differences) / kVariances;
}

// What edges from one node to the next say that roll and pitch vary: summed up to each node.
std::vector<double> variance_of_edges(const PoseGraph& graph) {
  std::vector<double> sum(graph.nodes().size() + 1, 0.0);
  for (const PoseEdge& edge : graph.edges())
    if (!edge.is_loop && edge.to == edge.from + 1)
      sum[edge.to] = edge.information.inverse().diagonal().tail<3>().mean();
  for (std::size_t i = 1; i < sum.size(); ++i) sum[i] += sum[i - 1];
  return sum;
}

double deviation_of(const PoseGraph& graph, const std::vector<const UpReading*>& readings,
                    const std::vector<double>& edges) {
  constexpr double kMost = Weighing::kMost_deg;
  if (readings.size() < Weighing::kFewest) return to_radians(kMost);
  const Vectors errors = errors_of(graph, readings);
  const double noise = std::max(std::pow(to_radians(Weighing::kLeast_deg), 2), noise_of(errors));
  // Of a drive that turns round, the halves may drift alike.
  for (const std::size_t lag : {errors.size() / 2, errors.size() / 4}) {
    const double far = variance_at(errors, lag);
    const double least = 2.0 * noise * (1.0 + Weighing::kShows / std::sqrt(static_cast<double>(errors.size() - lag)));
    if (far < least) continue;
    std::vector<double> said;
    for (std::size_t i = lag; i < readings.size(); ++i)
      said.push_back(std::abs(edges[readings[i]->node] - edges[readings[i - lag]->node]));
    const double less = std::max(1.0, median(std::move(said)) / (far - 2.0 * noise));
    return std::min(to_radians(kMost), std::sqrt(noise * less));
  }
  return to_radians(kMost);
}

}  // namespace

void weigh_ups(const PoseGraph& graph, std::span<UpReading> readings) {
  const std::vector<double> edges = variance_of_edges(graph);
  // How parts are tilted to each other is not known.
  using Source = std::pair<int, int>;
  const auto source_of = [](const UpReading& each) { return Source(each.sensor, each.part); };
  std::map<Source, std::vector<const UpReading*>> of_source;
  for (const UpReading& each : readings) of_source[source_of(each)].push_back(&each);
  std::map<Source, double> deviation_rad;
  for (const auto& [source, its] : of_source) deviation_rad[source] = deviation_of(graph, its, edges);
  for (UpReading& each : readings) each.deviation_rad = deviation_rad.at(source_of(each));
}

}  // namespace revisit
