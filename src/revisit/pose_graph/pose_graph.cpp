// SPDX-License-Identifier: Apache-2.0
#include <revisit/pose_graph/pose_graph.hpp>

#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

namespace revisit {

std::size_t PoseGraph::add_node(const Pose& T_world_node) {
  nodes_.push_back(T_world_node);
  return nodes_.size() - 1;
}

void PoseGraph::add_edge(const PoseEdge& edge) {
  if (edge.from >= nodes_.size() || edge.to >= nodes_.size() || edge.from == edge.to)
    throw std::invalid_argument("an edge from node " + std::to_string(edge.from) + " to node " +
                                std::to_string(edge.to) + "; allowed: two different ones of " +
                                std::to_string(nodes_.size()));
  if (!edge.information.allFinite() || !edge.information.isApprox(edge.information.transpose(), 1e-6) ||
      !edge.T_from_to.matrix().allFinite())
    throw std::invalid_argument("the edge from node " + std::to_string(edge.from) + " to node " +
                                std::to_string(edge.to) + " is not finite or its information not symmetric");
  edges_.push_back(edge);
}

void PoseGraph::set_ups(std::vector<UpReading> readings) {
  constexpr double kLengthOff = 1e-3;
  for (const UpReading& each : readings)
    if (each.node >= nodes_.size() || each.sensor < 0 || each.part < 0 || !(each.deviation_rad > 0.0) ||
        !(std::abs(each.up.norm() - 1.0) < kLengthOff))
      throw std::invalid_argument("a reading of gravity at node " + std::to_string(each.node) +
                                  "; allowed: a unit vector at one of " + std::to_string(nodes_.size()) +
                                  ", sensor and part from 0");
  ups_ = std::move(readings);
}

double squared_error(const PoseEdge& edge, const Pose& T_world_from, const Pose& T_world_to) {
  const Pose error = edge.T_from_to.inverse() * (T_world_from.inverse() * T_world_to);
  const Eigen::AngleAxisd turn(error.rotation());
  Vector6 xi;
  xi << error.translation(), turn.angle() * turn.axis();
  return xi.dot(edge.information * xi);
}

}  // namespace revisit
