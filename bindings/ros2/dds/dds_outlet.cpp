// SPDX-License-Identifier: Apache-2.0
#include "dds_outlet.hpp"

#include <algorithm>
#include <chrono>
#include <iostream>
#include <thread>
#include <vector>

#include <Eigen/Geometry>

namespace revisit::dds {
namespace {

// DDS writes from plain C structs, which it does not change. They point at strings that must outlive them.
char* text(const std::string& s) { return const_cast<char*>(s.c_str()); }
char* text(const std::string&& s) = delete;
const std::string& no_text() {
  static const std::string none;
  return none;
}

std_msgs_msg_dds__Header_ header_of(std::int64_t stamp_ns, const std::string& frame_id) {
  return {to_time(stamp_ns), text(frame_id)};
}
std_msgs_msg_dds__Header_ header_of(std::int64_t stamp_ns, const std::string&& frame_id) = delete;
geometry_msgs_msg_dds__Quaternion_ quaternion_of(const node::Transform3& T) {
  const Eigen::Quaterniond q(T.linear());
  return {q.x(), q.y(), q.z(), q.w()};
}
geometry_msgs_msg_dds__Pose_ pose_of(const node::Transform3& T) {
  const Eigen::Vector3d t = T.translation();
  return {{t.x(), t.y(), t.z()}, quaternion_of(T)};
}
geometry_msgs_msg_dds__PoseWithCovariance_ with_covariance(const node::Transform3& T,
                                                           const Eigen::Matrix<double, 6, 6>& covariance) {
  geometry_msgs_msg_dds__PoseWithCovariance_ message{pose_of(T), {}};
  Eigen::Map<Eigen::Matrix<double, 6, 6>>(message.covariance) = covariance;
  return message;
}
std::int64_t now_ns() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::system_clock::now().time_since_epoch())
      .count();
}

template <typename Sequence, typename Item>
Sequence sequence_of(std::vector<Item>& items) {
  Sequence sequence{};
  sequence._maximum = sequence._length = static_cast<std::uint32_t>(items.size());
  sequence._buffer = items.data();
  return sequence;
}

}  // namespace

builtin_interfaces_msg_dds__Time_ to_time(std::int64_t ns) {
  return {static_cast<std::int32_t>(ns / 1'000'000'000), static_cast<std::uint32_t>(ns % 1'000'000'000)};
}

node::Transform3 to_transform(const double* xyz, const geometry_msgs_msg_dds__Quaternion_& q) {
  return node::to_transform({xyz[0], xyz[1], xyz[2]}, {q.w, q.x, q.y, q.z});
}

DdsOutlet::DdsOutlet(dds_entity_t participant, const std::string& name)
    : name_(name),
      loops_(participant, name + "/loops", Quality::kReliable),
      loop_poses_(participant, name + "/loop_poses", Quality::kReliable),
      pose_(participant, name + "/pose", Quality::kReliable),
      path_(participant, name + "/path", Quality::kLatched),
      participant_(participant),
      map_(participant, name + "/map_cloud", Quality::kLatched),
      tf_(participant, "/tf", Quality::kReliable),
      diagnostics_(participant, "/diagnostics", Quality::kReliable),
      tf_static_(participant, "/tf_static", Quality::kLatched,
                 [this](const std::shared_ptr<const TfMessage>& message) { add_frames(*message); }) {}

void DdsOutlet::add_frames(const TfMessage& message) {
  const std::lock_guard lock(frames_mutex_);
  for (std::uint32_t i = 0; i < message.transforms._length; ++i) {
    const auto& each = message.transforms._buffer[i];
    const node::Transform3 T = to_transform(&each.transform.translation.x, each.transform.rotation);
    if (T.matrix().allFinite()) frames_.add(each.header.frame_id, each.child_frame_id, T);
  }
}

void DdsOutlet::send(const node::Loop& loop) {
  const auto header = header_of(loop.query_stamp_ns, loop.lidar_frame);
  const auto T = with_covariance(loop.T_match_query, loop.covariance);
  loops_.write({header, to_time(loop.match_stamp_ns), loop.query, loop.match, T, loop.probability});
  loop_poses_.write({header, with_covariance(loop.T_match_query, loop.covariance_about_match)});
}

void DdsOutlet::send(const node::Frame& frame) {
  const Eigen::Vector3d t = frame.T_parent_child.translation();
  std::vector<geometry_msgs_msg_dds__TransformStamped_> one{
      {header_of(frame.stamp_ns, frame.parent),
       text(frame.child),
       {{t.x(), t.y(), t.z()}, quaternion_of(frame.T_parent_child)}}};
  TfMessage message{};
  message.transforms = sequence_of<decltype(message.transforms)>(one);
  tf_.write(message);
}

void DdsOutlet::send(const node::MapPose& pose) {
  pose_.write({header_of(pose.stamp_ns, pose.map_frame), with_covariance(pose.T_map_lidar, pose.covariance)});
}

void DdsOutlet::send(const node::Graph& graph) {
  std::vector<geometry_msgs_msg_dds__PoseStamped_> poses;
  poses.reserve(graph.path.size());
  for (const auto& [stamp_ns, T] : graph.path) poses.push_back({header_of(stamp_ns, graph.map_frame), pose_of(T)});
  PathMessage message{};
  message.header = header_of(graph.path.empty() ? now_ns() : graph.path.back().first, graph.map_frame);
  message.poses = sequence_of<decltype(message.poses)>(poses);
  path_.write(message);
}

void DdsOutlet::send(const node::MapCloud& cloud) {
  constexpr std::uint8_t kFloat32 = 7;
  const std::string names[] = {"x", "y", "z", "intensity"};
  std::vector<sensor_msgs_msg_dds__PointField_> fields;
  for (std::uint32_t i = 0; i < 4; ++i) fields.push_back({text(names[i]), 4 * i, kFloat32, 1});
  PointCloud2 message{};
  message.header = header_of(now_ns(), cloud.map_frame);
  message.height = 1;
  message.fields = sequence_of<decltype(message.fields)>(fields);
  message.point_step = 16;
  message.is_dense = true;
  const auto write = [&](const Writer<PointCloud2>& writer, const std::vector<float>& points) {
    message.width = static_cast<std::uint32_t>(points.size() / 4);
    message.row_step = 16 * message.width;
    message.data._length = message.data._maximum = message.row_step;
    message.data._buffer = reinterpret_cast<std::uint8_t*>(const_cast<float*>(points.data()));
    writer.write(message);
  };
  write(map_, cloud.overview);
  // A new writer, which keeps as many messages for those that come later as there are tiles.
  tiles_.reset();
  tiles_ = std::make_unique<Writer<PointCloud2>>(participant_, name_ + "/map_tiles", Quality::kLatched,
                                                 static_cast<int>(std::max<std::size_t>(1, cloud.tiles.size())));
  for (const std::vector<float>& tile : cloud.tiles) write(*tiles_, tile);
}

void DdsOutlet::send(const node::Health& health) {
  std::vector<diagnostic_msgs_msg_dds__KeyValue_> values;
  for (const auto& [key, value] : health.values) values.push_back({text(key), text(value)});
  std::vector<diagnostic_msgs_msg_dds__DiagnosticStatus_> one{
      {static_cast<std::uint8_t>(health.level), text(name_), text(health.message), text(no_text()), {}}};
  one[0].values = sequence_of<decltype(one[0].values)>(values);
  DiagnosticArray message{};
  message.header = header_of(now_ns(), no_text());
  message.status = sequence_of<decltype(message.status)>(one);
  diagnostics_.write(message);
}

bool DdsOutlet::look_up(const std::string& target, const std::string& source, std::int64_t,
                        node::Transform3& T_target_source) {
  const std::lock_guard lock(frames_mutex_);
  const auto T = frames_.between(target, source);
  if (T) T_target_source = *T;
  return T.has_value();
}

void DdsOutlet::log(bool is_warning, const std::string& text) {
  std::cerr << (is_warning ? "warning: " : "info: ") << text << '\n';
}

}  // namespace revisit::dds
