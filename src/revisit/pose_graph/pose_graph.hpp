// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
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

  void archive(auto& fields) { fields(from, to, T_from_to, information, is_loop, weight); }
};

/// What an accelerometer said at a node: which way is up, a unit vector in the node's frame.
struct UpReading {
  std::size_t node = 0;
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
  int sensor = 0;                 ///< counted from 0: each is off by a degree or so, always the same way in its frame
  int part = 0;                   ///< of the graph, counted from 0: parts that no edge joins have their own up
  double deviation_rad = 0.0035;  ///< standard deviation, beside what the accelerometer is off (weigh_ups)
  double weight = 1.0;            ///< [0, 1], how far the last optimisation believed it

  void archive(auto& fields) { fields(node, up, sensor, part, deviation_rad, weight); }
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

  /// All readings of gravity. Throws std::invalid_argument as add_edge(), or for an up that is no unit vector.
  void set_ups(std::vector<UpReading> readings);

  void archive(auto& fields) {
    fields(nodes_, edges_, ups_);
    for (const PoseEdge& each : edges_)
      fields.require(each.from < nodes_.size() && each.to < nodes_.size() && each.from != each.to);
    for (const UpReading& each : ups_) fields.require(each.node < nodes_.size());
  }

  const std::vector<Pose>& nodes() const { return nodes_; }
  const std::vector<PoseEdge>& edges() const { return edges_; }

  struct Report {
    int iterations = 0;
    double cost_before = 0.0, cost_after = 0.0;      ///< half the weighted squared errors
    std::size_t loops_refused = 0, ups_refused = 0;  ///< of weight below one half
  };
  /// Moves the nodes to where the measurements agree best. Where loops or readings of gravity contradict the rest,
  /// these lose their weight, by graduated non-convexity with truncated least squares (Yang et al., RA-L 2020); where
  /// none does, one solution from the poses of before is enough. Settled where a step lowers the cost by a smaller
  /// share than `settled`. An error where Ceres cannot solve.
  Result<Report> optimise(double settled = kExactly);
  static constexpr double kExactly = 1e-6, kOnline = 1e-3;
  /// Of a right loop the squared error stays below this in 999 of 1000 cases (chi-square, 6 degrees of freedom).
  static constexpr double kTruncation = 22.46;

  /// The g2o form (VERTEX_SE3:QUAT, EDGE_SE3:QUAT); edges between nodes that do not follow each other are loops.
  Status write_g2o(const std::filesystem::path& file) const;
  static Result<PoseGraph> read_g2o(const std::filesystem::path& file);

 private:
  std::vector<Pose> nodes_;
  std::vector<PoseEdge> edges_;
  std::vector<UpReading> ups_;
};

/// Squared error of an edge at these poses, in units of its information: of a right edge, chi-square with 6 degrees of
/// freedom.
double squared_error(const PoseEdge& edge, const Pose& T_world_from, const Pose& T_world_to);

}  // namespace revisit
