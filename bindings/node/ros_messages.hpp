// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstring>
#include <string>
#include <utility>

#include "messages.hpp"

/// Messages of ROS out of the node's structs, and back. Fields have the same names in ROS 1 and ROS 2; what differs is
/// in `Ros`: the messages' types (Header, Pose, Path, ...), `stamp(ns)` and `ns(stamp)`. C++17.
namespace revisit::node {

template <typename Ros>
struct Messages {
  using Matrix6 = Eigen::Matrix<double, 6, 6>;

  static typename Ros::Header header(const std::string& frame, std::int64_t stamp_ns) {
    typename Ros::Header header;
    header.frame_id = frame;
    header.stamp = Ros::stamp(stamp_ns);
    return header;
  }
  template <typename Message>
  static void set(Message& message, const Eigen::Vector3d& v) {
    message.x = v.x(), message.y = v.y(), message.z = v.z();
  }
  template <typename Message>
  static void set(Message& message, const Eigen::Quaterniond& q) {
    message.x = q.x(), message.y = q.y(), message.z = q.z(), message.w = q.w();
  }
  static typename Ros::Pose pose(const Transform3& T) {
    typename Ros::Pose pose;
    set(pose.position, Eigen::Vector3d(T.translation()));
    set(pose.orientation, Eigen::Quaterniond(T.linear()));
    return pose;
  }
  static typename Ros::PoseWithCovariance pose(const Transform3& T, const Matrix6& covariance) {
    typename Ros::PoseWithCovariance message;
    message.pose = pose(T);
    Eigen::Map<Matrix6>(message.covariance.data()) = covariance;
    return message;
  }

  static typename Ros::Loop loop(const Loop& loop) {
    typename Ros::Loop message;
    message.header = header(loop.lidar_frame, loop.query_stamp_ns);
    message.match_stamp = Ros::stamp(loop.match_stamp_ns);
    message.query = loop.query, message.match = loop.match;
    message.t_match_query = pose(loop.T_match_query, loop.covariance);
    message.probability = loop.probability;
    return message;
  }
  static typename Ros::StampedPose pose(const Loop& loop) {
    typename Ros::StampedPose message;
    message.header = header(loop.lidar_frame, loop.query_stamp_ns);
    message.pose = pose(loop.T_match_query, loop.covariance_about_match);
    return message;
  }
  static typename Ros::StampedPose pose(const MapPose& pose_in_map) {
    typename Ros::StampedPose message;
    message.header = header(pose_in_map.map_frame, pose_in_map.stamp_ns);
    message.pose = pose(pose_in_map.T_map_lidar, pose_in_map.covariance);
    return message;
  }
  static typename Ros::TransformStamped transform(const Frame& frame) {
    typename Ros::TransformStamped message;
    message.header = header(frame.parent, frame.stamp_ns);
    message.child_frame_id = frame.child;
    set(message.transform.translation, Eigen::Vector3d(frame.T_parent_child.translation()));
    set(message.transform.rotation, Eigen::Quaterniond(frame.T_parent_child.linear()));
    return message;
  }

  static typename Ros::Path path(const Graph& graph) {
    typename Ros::Path path;
    path.header = header(graph.map_frame, graph.path.empty() ? 0 : graph.path.back().first);
    for (const auto& [stamp_ns, T] : graph.path) {
      typename Ros::PoseStamped stamped;
      stamped.header = header(graph.map_frame, stamp_ns);
      stamped.pose = pose(T);
      path.poses.push_back(stamped);
    }
    return path;
  }
  /// A line a loop, between the poses of the path.
  static typename Ros::MarkerArray loops(const Graph& graph) {
    typename Ros::Marker lines;
    lines.header = header(graph.map_frame, graph.path.empty() ? 0 : graph.path.back().first);
    lines.ns = "loops";
    lines.type = Ros::Marker::LINE_LIST;
    lines.pose.orientation.w = 1.0;
    lines.scale.x = 0.1;
    lines.color.r = 0.84f, lines.color.g = 0.37f, lines.color.a = 1.f;
    for (const auto& [from, to] : graph.loops)
      for (const std::size_t end : {from, to}) lines.points.push_back(pose(graph.path[end].second).position);
    typename Ros::MarkerArray markers;
    markers.markers.push_back(lines);
    return markers;
  }

  static typename Ros::PointCloud2 cloud(const std::string& frame, const std::vector<float>& points,
                                         std::int64_t stamp_ns) {
    typename Ros::PointCloud2 message;
    message.header = header(frame, stamp_ns);
    const std::array<const char*, 4> names{"x", "y", "z", "intensity"};
    for (std::size_t i = 0; i < names.size(); ++i) {
      typename Ros::PointField field;
      field.name = names[i], field.offset = static_cast<std::uint32_t>(sizeof(float) * i), field.count = 1;
      field.datatype = Ros::PointField::FLOAT32;
      message.fields.push_back(field);
    }
    message.height = 1;
    message.width = static_cast<std::uint32_t>(points.size() / names.size());
    message.point_step = names.size() * sizeof(float);
    message.row_step = message.point_step * message.width;
    message.is_dense = true;
    message.data.resize(message.row_step);
    if (!points.empty()) std::memcpy(message.data.data(), points.data(), message.data.size());
    return message;
  }
  static typename Ros::OccupancyGrid grid(MapGrid cells, std::int64_t stamp_ns) {
    typename Ros::OccupancyGrid message;
    message.header = header(cells.map_frame, stamp_ns);
    message.info.map_load_time = message.header.stamp;
    message.info.resolution = static_cast<float>(cells.cell_m);
    message.info.width = cells.width, message.info.height = cells.height;
    message.info.origin.position.x = cells.x_m, message.info.origin.position.y = cells.y_m;
    message.info.origin.orientation.w = 1.0;
    message.data = std::move(cells.cells);
    return message;
  }
  static typename Ros::DiagnosticArray health(const Health& health, const std::string& name, std::int64_t stamp_ns) {
    typename Ros::DiagnosticStatus status;
    status.name = name;
    status.level = static_cast<decltype(status.level)>(health.level);
    status.message = health.message;
    for (const auto& [key, value] : health.values) {
      typename Ros::KeyValue pair;
      pair.key = key, pair.value = value;
      status.values.push_back(pair);
    }
    typename Ros::DiagnosticArray message;
    message.header.stamp = Ros::stamp(stamp_ns);
    message.status.push_back(status);
    return message;
  }

  template <typename Vector>
  static Eigen::Vector3d vector(const Vector& v) {
    return {v.x, v.y, v.z};
  }
  template <typename Position, typename Rotation>
  static Transform3 transform(const Position& p, const Rotation& q) {
    return to_transform(vector(p), {q.w, q.x, q.y, q.z});
  }
  static Imu imu(const typename Ros::Imu& m) {
    return {Ros::ns(m.header.stamp), m.header.frame_id, vector(m.angular_velocity), vector(m.linear_acceleration)};
  }
  static Odometry odometry(const typename Ros::Odometry& m) {
    return {Ros::ns(m.header.stamp), m.header.frame_id, m.child_frame_id,
            transform(m.pose.pose.position, m.pose.pose.orientation)};
  }
  static InitialPose initial_pose(const typename Ros::StampedPose& m) {
    return {m.header.frame_id, transform(m.pose.pose.position, m.pose.pose.orientation)};
  }
  static bool is_fix(const typename Ros::NavSatFix& m) { return m.status.status >= Ros::NavSatStatus::STATUS_FIX; }
  static GpsFix fix(const typename Ros::NavSatFix& m) {
    GpsFix fix{Ros::ns(m.header.stamp), m.latitude, m.longitude, m.altitude};
    const auto& covariance = m.position_covariance;
    if (m.position_covariance_type != Ros::NavSatFix::COVARIANCE_TYPE_UNKNOWN)
      fix.deviation_m = Eigen::Vector3d(covariance[0], covariance[4], covariance[8]).cwiseSqrt();
    return fix;
  }
};

}  // namespace revisit::node
