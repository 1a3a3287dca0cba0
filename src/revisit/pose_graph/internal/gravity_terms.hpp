// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <span>
#include <vector>

#include <ceres/ceres.h>
#include <Eigen/Geometry>

#include <revisit/pose_graph/pose_graph.hpp>

namespace revisit::pose_graph_internal {

/// Readings of gravity in an optimisation. Found with the poses are which way is up in each part of the graph, and how
/// much each accelerometer is off: both say the same of a straight way, a bend tells them apart.
class GravityTerms {
 public:
  GravityTerms(std::span<const UpReading> readings, const std::vector<Pose>& nodes);
  /// `rotation_of`: the quaternion (x, y, z, w) that the problem holds for a node.
  void add_to(ceres::Problem& problem, const std::function<double*(std::size_t)>& rotation_of);
  /// Of a right reading: chi-square with 2 degrees of freedom.
  double squared_error(const UpReading& reading, const Eigen::Quaterniond& q_world_node) const;

 private:
  std::span<const UpReading> readings_;
  std::vector<Eigen::Vector3d> up_, off_;  ///< unit vectors in the world, by part; in the sensor's frame, by sensor
};

}  // namespace revisit::pose_graph_internal
