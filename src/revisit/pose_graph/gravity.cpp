// SPDX-License-Identifier: Apache-2.0
#include <revisit/pose_graph/gravity.hpp>

#include <algorithm>
#include <cmath>
#include <map>
#include <vector>

#include <Eigen/LU>

namespace revisit {
namespace {

struct Weighing {
  static constexpr int kRounds = 20;  ///< until both settle: where up is, and how much the sensor is off
  static constexpr std::size_t kFewest = 16;
  static constexpr double kShows = 1.5;  ///< as much as distant readings must differ more than neighbours, if it drifts
  static constexpr double kLeast_deg = 0.05, kMost_deg = 10.0;
  static constexpr double kMedianOfSquares = 1.386;  ///< of two coordinates, in variances (chi-square)
};

using Vectors = std::vector<Eigen::Vector3d>;

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// How far readings of one sensor are from what they have in common, in the world. Those that are far off count little.
Vectors errors_of(const PoseGraph& graph, const std::vector<const UpReading*>& readings) {
  Vectors errors(readings.size());
  std::vector<double> weights(readings.size(), 1.0), sizes(readings.size());
  Eigen::Vector3d off = Eigen::Vector3d::Zero();
  for (int round = 0; round < Weighing::kRounds; ++round) {
    Eigen::Vector3d up = Eigen::Vector3d::Zero(), more_off = Eigen::Vector3d::Zero();
    double sum = 0.0;
    for (std::size_t i = 0; i < readings.size(); ++i)
      up += weights[i] * (graph.nodes()[readings[i]->node].linear() * (readings[i]->up - off));
    up.normalize();
    for (std::size_t i = 0; i < readings.size(); ++i) {
      const auto R = graph.nodes()[readings[i]->node].linear();
      errors[i] = R * (readings[i]->up - off) - up;
      more_off += weights[i] * (R.transpose() * errors[i]);
      sum += weights[i];
      sizes[i] = errors[i].norm();
    }
    off += more_off / sum;
    const double usual = std::max(to_radians(Weighing::kLeast_deg), median(sizes));
    for (std::size_t i = 0; i < readings.size(); ++i)
      weights[i] = 1.0 / std::pow(1.0 + std::pow(sizes[i] / (2.0 * usual), 2), 2);
  }
  return errors;
}

// Of one coordinate of the difference between errors that lie `lag` readings apart.
double variance_at(const Vectors& errors, std::size_t lag) {
  std::vector<double> squares;
  for (std::size_t i = lag; i < errors.size(); ++i) squares.push_back((errors[i] - errors[i - lag]).squaredNorm());
  return median(std::move(squares)) / Weighing::kMedianOfSquares;
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
  const std::size_t lag = errors.size() / 2;
  const double near = variance_at(errors, 1), far = variance_at(errors, lag);
  if (far < Weighing::kShows * near) return to_radians(kMost);
  const double drift = (far - near) / static_cast<double>(lag - 1);
  const double noise = std::max(std::pow(to_radians(Weighing::kLeast_deg), 2), 0.5 * (near - drift));
  std::vector<double> said;
  for (std::size_t i = 1; i < readings.size(); ++i)
    said.push_back(std::abs(edges[readings[i]->node] - edges[readings[i - 1]->node]));
  const double less = std::max(1.0, median(std::move(said)) / drift);
  return std::min(to_radians(kMost), std::sqrt(noise * less));
}

}  // namespace

void weigh_ups(const PoseGraph& graph, std::span<UpReading> readings) {
  const std::vector<double> edges = variance_of_edges(graph);
  std::map<int, std::vector<const UpReading*>> of_sensor;
  for (const UpReading& each : readings) of_sensor[each.sensor].push_back(&each);
  std::map<int, double> deviation_rad;
  for (const auto& [sensor, its] : of_sensor) deviation_rad[sensor] = deviation_of(graph, its, edges);
  for (UpReading& each : readings) each.deviation_rad = deviation_rad.at(each.sensor);
}

}  // namespace revisit
