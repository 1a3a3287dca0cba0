// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <vector>

#include <revisit/core/pose.hpp>
#include <revisit/core/result.hpp>

namespace revisit {

/// What is measured between two nodes.
struct PoseEdge {
  std::size_t from = 0, to = 0;
  Pose T_from_to = Pose::Identity();
  /// Inverse covariance of xi where the true pose is T_from_to * small_motion(xi): metres, then radians.
  Matrix6 information = Matrix6::Identity();
  bool is_loop = false;  ///< may be wrong: its weight is found, the others' is 1
  double weight = 1.0;   ///< [0, 1], how far the last optimisation believed it
};

/// Poses that hang together by relative measurements. Node 0 stays where it is. Belongs to one thread at a time.
class PoseGraph {
 public:
  /// The node's number. `T_world_node`: where it is believed to be.
  std::size_t add_node(const Pose& T_world_node);
  /// Where it is believed to be, anew.
  void move_node(std::size_t node, const Pose& T_world_node) { nodes_.at(node) = T_world_node; }
  /// Throws std::invalid_argument for nodes that are not there, a node with itself, or an information that is not
  /// finite and symmetric.
  void add_edge(const PoseEdge& edge);

  const std::vector<Pose>& nodes() const { return nodes_; }
  const std::vector<PoseEdge>& edges() const { return edges_; }

  struct Report {
    int iterations = 0;
    double cost_before = 0.0, cost_after = 0.0;  ///< half the weighted squared errors
    std::size_t loops_refused = 0;               ///< of weight below one half
  };
  /// Moves the nodes to where the measurements agree best. Where loops contradict the rest, these lose their weight, by
  /// graduated non-convexity with truncated least squares (Yang et al., RA-L 2020); where none does, one solution from
  /// the poses of before is enough. Settled where a step lowers the cost by a smaller share than `settled`. An error
  /// where Ceres cannot solve.
  Result<Report> optimise(double settled = kExactly);
  static constexpr double kExactly = 1e-6, kOnline = 1e-3;

  /// The g2o form (VERTEX_SE3:QUAT, EDGE_SE3:QUAT); edges between nodes that do not follow each other are loops.
  Status write_g2o(const std::filesystem::path& file) const;
  static Result<PoseGraph> read_g2o(const std::filesystem::path& file);

 private:
  // Weights of the loops at this convexity, from their squared errors; whether all are decided.
  bool reweigh(const std::function<double(const PoseEdge&)>& squared, double mu);

  std::vector<Pose> nodes_;
  std::vector<PoseEdge> edges_;
};

/// Squared error of an edge at these poses, in units of its information: of a right edge, chi-square with 6 degrees of
/// freedom.
double squared_error(const PoseEdge& edge, const Pose& T_world_from, const Pose& T_world_to);

}  // namespace revisit
