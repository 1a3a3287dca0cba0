// SPDX-License-Identifier: Apache-2.0
#include <revisit/pose_graph/earth.hpp>

#include <algorithm>
#include <cmath>
#include <optional>

#include <Eigen/SVD>

namespace revisit {
namespace {

struct Placing {
  static constexpr std::size_t kFewest = 4;  ///< fixes of a part
  static constexpr double kWide = 4.0;       ///< how far they must spread, in deviations, to fix a heading
  static constexpr double kLeast_m = 0.3;    ///< where on the vehicle the antenna is, nobody said
  static constexpr int kRounds = 15;         ///< of reweighting
  static constexpr double kTilt_deg = 10.0;  ///< from upright, where a way is straight and tells nothing of it
};

struct Pairs {
  std::vector<Eigen::Vector3d> world, earth;
  std::vector<double> deviation_m;
};

// Where weighted points lie best on others: Kabsch, or about the vertical alone.
Pose align(const Pairs& pairs, const std::vector<double>& weights, bool upright) {
  double sum = 0.0;
  Eigen::Vector3d mean_world = Eigen::Vector3d::Zero(), mean_earth = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < weights.size(); ++i) {
    sum += weights[i];
    mean_world += weights[i] * pairs.world[i];
    mean_earth += weights[i] * pairs.earth[i];
  }
  mean_world /= sum, mean_earth /= sum;
  Eigen::Matrix3d both = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i < weights.size(); ++i)
    both += weights[i] * (pairs.earth[i] - mean_earth) * (pairs.world[i] - mean_world).transpose();
  Pose T = Pose::Identity();
  if (upright) {
    const double yaw_rad = std::atan2(both(1, 0) - both(0, 1), both(0, 0) + both(1, 1));
    T.linear() = Eigen::AngleAxisd(yaw_rad, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  } else {
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(both, Eigen::ComputeFullU | Eigen::ComputeFullV);
    const double sign = (svd.matrixU() * svd.matrixV().transpose()).determinant();
    T.linear() = svd.matrixU() * Eigen::Vector3d(1.0, 1.0, sign).asDiagonal() * svd.matrixV().transpose();
  }
  T.translation() = mean_earth - T.linear() * mean_world;
  return T;
}

// The standard deviation of points along the second of their principal axes, and along the first.
std::pair<double, double> spread_m(const std::vector<Eigen::Vector3d>& points) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const auto& p : points) mean += p;
  mean /= static_cast<double>(points.size());
  Eigen::Matrix3d squares = Eigen::Matrix3d::Zero();
  for (const auto& p : points) squares += (p - mean) * (p - mean).transpose();
  const Eigen::Vector3d values =
      Eigen::JacobiSVD<Eigen::Matrix3d>(squares / static_cast<double>(points.size())).singularValues();
  return {std::sqrt(values[1]), std::sqrt(values[0])};
}

// Before the graph is solved: fixes that are far off count for little.
std::optional<Pose> place_roughly(const Pairs& pairs) {
  if (pairs.world.size() < Placing::kFewest) return std::nullopt;
  std::vector<double> sorted = pairs.deviation_m;
  std::nth_element(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2), sorted.end());
  const double typical_m = sorted[sorted.size() / 2];
  const auto [across_m, along_m] = spread_m(pairs.world);
  if (along_m < Placing::kWide * typical_m) return std::nullopt;
  const bool upright = across_m < 2.0 * Placing::kWide * typical_m;
  std::vector<double> weights(pairs.world.size(), 1.0), errors_m(weights.size());
  Pose T = align(pairs, weights, upright);
  for (int round = 0; round < Placing::kRounds; ++round) {
    for (std::size_t i = 0; i < weights.size(); ++i)
      errors_m[i] = (T * pairs.world[i] - pairs.earth[i]).norm() / pairs.deviation_m[i];
    sorted = errors_m;
    std::nth_element(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2), sorted.end());
    const double usual = std::max(1.0, sorted[sorted.size() / 2]);
    for (std::size_t i = 0; i < weights.size(); ++i)
      weights[i] = 1.0 / std::pow(pairs.deviation_m[i] * (1.0 + std::pow(errors_m[i] / (2.0 * usual), 2)), 2);
    T = align(pairs, weights, upright);
  }
  return T;
}

}  // namespace

Result<std::vector<std::optional<Pose>>> settle_on_earth(PoseGraph& graph, std::span<const EarthFix> fixes,
                                                         std::span<const int> part_of_node) {
  const std::size_t parts =
      part_of_node.empty() ? 0
                           : static_cast<std::size_t>(*std::max_element(part_of_node.begin(), part_of_node.end())) + 1;
  std::vector<std::optional<Pose>> T_earth_world(parts);
  std::vector<Pairs> pairs(parts);
  for (const EarthFix& fix : fixes) {
    Pairs& of_part = pairs[static_cast<std::size_t>(part_of_node[fix.node])];
    of_part.world.push_back(graph.nodes()[fix.node].translation());
    of_part.earth.push_back(fix.position_m);
    of_part.deviation_m.push_back(std::max(Placing::kLeast_m, fix.deviation_m.head<2>().norm()));
  }
  // The earth is one more node for each part, whose pose is found with the others.
  PoseGraph extended = graph;
  std::vector<std::size_t> earth(parts);
  for (std::size_t part = 0; part < parts; ++part) {
    T_earth_world[part] = place_roughly(pairs[part]);
    if (!T_earth_world[part]) continue;
    earth[part] = extended.add_node(T_earth_world[part]->inverse());
    const auto first = std::find(part_of_node.begin(), part_of_node.end(), static_cast<int>(part));
    const auto node = static_cast<std::size_t>(first - part_of_node.begin());
    PoseEdge upright{earth[part], node, *T_earth_world[part] * graph.nodes()[node], Matrix6::Zero()};
    upright.information.diagonal().tail<3>().setConstant(std::pow(to_radians(Placing::kTilt_deg), -2));
    extended.add_edge(upright);
  }
  for (const EarthFix& fix : fixes) {
    const auto part = static_cast<std::size_t>(part_of_node[fix.node]);
    if (!T_earth_world[part]) continue;
    PoseEdge edge{earth[part], fix.node, Pose::Identity(), Matrix6::Zero(), true};
    edge.T_from_to.translation() = fix.position_m;
    edge.information.diagonal().head<3>() = fix.deviation_m.cwiseMax(Placing::kLeast_m).cwiseAbs2().cwiseInverse();
    extended.add_edge(edge);
  }
  const auto report = extended.optimise(PoseGraph::kExactly);
  if (!report) return report.error();
  for (std::size_t node = 0; node < graph.nodes().size(); ++node) graph.move_node(node, extended.nodes()[node]);
  for (std::size_t part = 0; part < parts; ++part)
    if (T_earth_world[part]) T_earth_world[part] = extended.nodes()[earth[part]].inverse();
  return T_earth_world;
}

}  // namespace revisit
