// SPDX-License-Identifier: Apache-2.0
// The node of ROS 1. C++17, as the message headers are: it turns messages into structs and back, and nothing else.
#include <csignal>
#include <cstring>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include <diagnostic_msgs/DiagnosticArray.h>
#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <nav_msgs/Odometry.h>
#include <nav_msgs/Path.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <sensor_msgs/Imu.h>
#include <sensor_msgs/NavSatFix.h>
#include <sensor_msgs/PointCloud2.h>
#include <sensor_msgs/point_cloud2_iterator.h>
#include <std_srvs/Trigger.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_broadcaster.h>
#include <tf2_ros/transform_listener.h>
#include <visualization_msgs/MarkerArray.h>

#include <revisit_ros/Loop.h>

#include "node.hpp"

namespace {

namespace node = revisit::node;

ros::Time to_time(std::int64_t ns) {
  return ros::Time(static_cast<std::uint32_t>(ns / 1'000'000'000), static_cast<std::uint32_t>(ns % 1'000'000'000));
}
std::int64_t to_ns(const ros::Time& time) { return static_cast<std::int64_t>(time.toNSec()); }

template <typename Point>
Point to_point(const Eigen::Vector3d& p) {
  Point point;
  point.x = p.x(), point.y = p.y(), point.z = p.z();
  return point;
}
geometry_msgs::Quaternion to_quaternion(const node::Transform3& T) {
  const Eigen::Quaterniond q(T.linear());
  geometry_msgs::Quaternion message;
  message.x = q.x(), message.y = q.y(), message.z = q.z(), message.w = q.w();
  return message;
}
geometry_msgs::Pose to_pose(const node::Transform3& T) {
  geometry_msgs::Pose pose;
  pose.position = to_point<geometry_msgs::Point>(T.translation());
  pose.orientation = to_quaternion(T);
  return pose;
}
template <typename Position>
node::Transform3 to_transform(const Position& p, const geometry_msgs::Quaternion& q) {
  return node::to_transform({p.x, p.y, p.z}, {q.w, q.x, q.y, q.z});
}
using Matrix6 = Eigen::Matrix<double, 6, 6>;

class Outlet final : public node::Outlet {
 public:
  explicit Outlet(ros::NodeHandle& handle) : listener_(buffer_) {
    loops_ = handle.advertise<revisit_ros::Loop>("loops", 100);
    loop_poses_ = handle.advertise<geometry_msgs::PoseWithCovarianceStamped>("loop_poses", 100);
    pose_ = handle.advertise<geometry_msgs::PoseWithCovarianceStamped>("pose", 10);
    path_ = handle.advertise<nav_msgs::Path>("path", 1, true);
    graph_ = handle.advertise<visualization_msgs::MarkerArray>("graph", 1, true);
    map_ = handle.advertise<sensor_msgs::PointCloud2>("map_cloud", 1, true);
    diagnostics_ = handle.advertise<diagnostic_msgs::DiagnosticArray>("/diagnostics", 10);
  }

  void send(const node::Loop& loop) override {
    revisit_ros::Loop message;
    message.header.stamp = to_time(loop.query_stamp_ns);
    message.header.frame_id = loop.lidar_frame;
    message.match_stamp = to_time(loop.match_stamp_ns);
    message.query = loop.query;
    message.match = loop.match;
    message.t_match_query.pose = to_pose(loop.T_match_query);
    Eigen::Map<Matrix6>(message.t_match_query.covariance.data()) = loop.covariance;
    message.probability = loop.probability;
    loops_.publish(message);
    geometry_msgs::PoseWithCovarianceStamped geometry;
    geometry.header = message.header;
    geometry.pose = message.t_match_query;
    Eigen::Map<Matrix6>(geometry.pose.covariance.data()) = loop.covariance_about_match;
    loop_poses_.publish(geometry);
  }
  void send(const node::Frame& frame) override {
    geometry_msgs::TransformStamped message;
    message.header.stamp = to_time(frame.stamp_ns);
    message.header.frame_id = frame.parent;
    message.child_frame_id = frame.child;
    message.transform.translation = to_point<geometry_msgs::Vector3>(frame.T_parent_child.translation());
    message.transform.rotation = to_quaternion(frame.T_parent_child);
    broadcaster_.sendTransform(message);
  }
  void send(const node::MapPose& pose) override {
    geometry_msgs::PoseWithCovarianceStamped message;
    message.header.stamp = to_time(pose.stamp_ns);
    message.header.frame_id = pose.map_frame;
    message.pose.pose = to_pose(pose.T_map_lidar);
    Eigen::Map<Matrix6>(message.pose.covariance.data()) = pose.covariance;
    pose_.publish(message);
  }
  void send(const node::Graph& graph) override {
    nav_msgs::Path path;
    path.header.frame_id = graph.map_frame;
    path.header.stamp = graph.path.empty() ? ros::Time::now() : to_time(graph.path.back().first);
    visualization_msgs::Marker lines;
    lines.header = path.header;
    lines.ns = "loops";
    lines.type = visualization_msgs::Marker::LINE_LIST;
    lines.pose.orientation.w = 1.0;
    lines.scale.x = 0.1;
    lines.color.r = 0.84f, lines.color.g = 0.37f, lines.color.a = 1.f;
    for (const auto& [stamp_ns, T] : graph.path) {
      geometry_msgs::PoseStamped pose;
      pose.header.frame_id = graph.map_frame;
      pose.header.stamp = to_time(stamp_ns);
      pose.pose = to_pose(T);
      path.poses.push_back(pose);
    }
    for (const auto& [from, to] : graph.loops)
      for (const std::size_t end : {from, to}) lines.points.push_back(path.poses[end].pose.position);
    visualization_msgs::MarkerArray markers;
    markers.markers.push_back(lines);
    path_.publish(path);
    graph_.publish(markers);
  }
  void send(const node::MapCloud& cloud) override {
    sensor_msgs::PointCloud2 message;
    message.header.frame_id = cloud.map_frame;
    message.header.stamp = ros::Time::now();
    sensor_msgs::PointCloud2Modifier modifier(message);
    using Field = sensor_msgs::PointField;
    modifier.setPointCloud2Fields(4, "x", 1, Field::FLOAT32, "y", 1, Field::FLOAT32, "z", 1, Field::FLOAT32,
                                  "intensity", 1, Field::FLOAT32);
    modifier.resize(cloud.points.size() / 4);
    std::memcpy(message.data.data(), cloud.points.data(), cloud.points.size() * sizeof(float));
    map_.publish(message);
  }
  void send(const node::Health& health) override {
    diagnostic_msgs::DiagnosticArray message;
    message.header.stamp = ros::Time::now();
    diagnostic_msgs::DiagnosticStatus status;
    status.name = ros::this_node::getName();
    status.level = static_cast<std::int8_t>(health.level);
    status.message = health.message;
    for (const auto& [key, value] : health.values) {
      diagnostic_msgs::KeyValue pair;
      pair.key = key, pair.value = value;
      status.values.push_back(pair);
    }
    message.status.push_back(status);
    diagnostics_.publish(message);
  }
  // tf2's own wait goes by the simulated clock, which may stand still.
  bool look_up(const std::string& target, const std::string& source, std::int64_t stamp_ns, bool may_wait,
               node::Transform3& T_target_source) override {
    for (int tries = may_wait ? 10 : 0;; --tries) {
      try {
        const auto found = buffer_.lookupTransform(target, source, to_time(stamp_ns)).transform;
        T_target_source = to_transform(found.translation, found.rotation);
        return true;
      } catch (const tf2::TransformException&) {
        if (tries <= 0) return false;
        ros::WallDuration(0.01).sleep();
      }
    }
  }
  void log(bool is_warning, const std::string& text) override {
    ROS_LOG_STREAM(is_warning ? ros::console::levels::Warn : ros::console::levels::Info, ROSCONSOLE_DEFAULT_NAME, text);
  }

 private:
  tf2_ros::Buffer buffer_;
  tf2_ros::TransformListener listener_;
  tf2_ros::TransformBroadcaster broadcaster_;
  ros::Publisher loops_, loop_poses_, pose_, path_, graph_, map_, diagnostics_;
};

node::Cloud to_cloud(const sensor_msgs::PointCloud2ConstPtr& message) {
  node::Cloud cloud;
  cloud.stamp_ns = to_ns(message->header.stamp);
  cloud.frame_id = message->header.frame_id;
  for (const auto& field : message->fields)
    if (field.count <= 1) cloud.fields.push_back({field.name, field.offset, field.datatype});
  cloud.width = message->width, cloud.height = message->height;
  cloud.point_step = message->point_step, cloud.row_step = message->row_step;
  cloud.is_big_endian = message->is_bigendian != 0;
  cloud.data = message->data.data();
  cloud.size = message->data.size();
  cloud.owner = std::shared_ptr<const void>(message.get(), [message](const void*) {});
  return cloud;
}

node::GpsFix to_fix(const sensor_msgs::NavSatFix& message) {
  node::GpsFix fix{to_ns(message.header.stamp), message.latitude, message.longitude, message.altitude};
  const auto& covariance = message.position_covariance;
  if (message.position_covariance_type != sensor_msgs::NavSatFix::COVARIANCE_TYPE_UNKNOWN)
    fix.deviation_m = Eigen::Vector3d(covariance[0], covariance[4], covariance[8]).cwiseSqrt();
  return fix;
}

// Parameters of ROS have types, ours are texts. False with the reason where one is none of ours.
bool read_settings(const ros::NodeHandle& handle, node::Settings& settings, std::string& error) {
  const std::string above = handle.getNamespace() + "/";
  std::vector<std::string> names;
  handle.getParamNames(names);
  for (const std::string& full : names) {
    XmlRpc::XmlRpcValue value;
    if (full.compare(0, above.size(), above) != 0 || !handle.getParam(full, value)) continue;
    std::ostringstream text;
    if (value.getType() == XmlRpc::XmlRpcValue::TypeString)
      text << static_cast<std::string>(value);
    else if (value.getType() == XmlRpc::XmlRpcValue::TypeBoolean)
      text << (static_cast<bool>(value) ? "true" : "false");
    else
      value.write(text);
    std::string name = full.substr(above.size());
    std::replace(name.begin(), name.end(), '/', '.');
    if (!node::set(settings, name, text.str(), error)) return false;
  }
  return true;
}

volatile std::sig_atomic_t is_asked_to_end = 0;

}  // namespace

int main(int argc, char** argv) {
  ros::init(argc, argv, "revisit", ros::init_options::NoSigintHandler);
  for (const int signal : {SIGINT, SIGTERM}) std::signal(signal, [](int) { is_asked_to_end = 1; });
  for (bool is_first = true; !ros::master::check(); is_first = false, ros::WallDuration(0.2).sleep()) {
    if (is_asked_to_end != 0) return 1;
    if (is_first)
      ROS_WARN_STREAM("revisit: waiting for the master at " << ros::master::getURI() << "; is roscore there?");
  }
  ros::NodeHandle handle, own("~");
  Outlet outlet(own);
  node::Settings settings;
  std::string message;
  const bool is_set = read_settings(own, settings, message);
  const auto revisit = is_set ? node::Node::make(settings, outlet, message) : nullptr;
  if (!revisit) {
    ROS_FATAL_STREAM(message);
    return 1;
  }
  constexpr std::uint32_t kClouds = 5, kSmall = 500;
  const auto clouds = handle.subscribe<sensor_msgs::PointCloud2>(
      "points", kClouds, [&](const sensor_msgs::PointCloud2ConstPtr& cloud) { revisit->add(to_cloud(cloud)); });
  const auto imu = handle.subscribe<sensor_msgs::Imu>("imu", kSmall, [&](const sensor_msgs::ImuConstPtr& m) {
    const auto vector = [](const geometry_msgs::Vector3& v) { return Eigen::Vector3d(v.x, v.y, v.z); };
    revisit->add(node::Imu{to_ns(m->header.stamp), m->header.frame_id, vector(m->angular_velocity),
                           vector(m->linear_acceleration)});
  });
  const auto odometry = handle.subscribe<nav_msgs::Odometry>("odom", kSmall, [&](const nav_msgs::OdometryConstPtr& m) {
    revisit->add(node::Odometry{to_ns(m->header.stamp), m->header.frame_id, m->child_frame_id,
                                to_transform(m->pose.pose.position, m->pose.pose.orientation)});
  });
  const auto fixes =
      handle.subscribe<sensor_msgs::NavSatFix>("fix", kSmall, [&](const sensor_msgs::NavSatFixConstPtr& m) {
        if (m->status.status >= sensor_msgs::NavSatStatus::STATUS_FIX) revisit->add(to_fix(*m));
      });
  using Initial = geometry_msgs::PoseWithCovarianceStamped;
  const auto initial = handle.subscribe<Initial>("initialpose", 1, [&](const Initial::ConstPtr& m) {
    revisit->add(node::InitialPose{m->header.frame_id, to_transform(m->pose.pose.position, m->pose.pose.orientation)});
  });
  // Services wait for the scan at work, messages do not.
  ros::CallbackQueue service_queue;
  ros::NodeHandle services("~");
  services.setCallbackQueue(&service_queue);
  using Request = std_srvs::Trigger::Request;
  using Response = std_srvs::Trigger::Response;
  const auto offer = [&](const std::string& name, auto act) {
    return services.advertiseService<Request, Response>(name, [act](Request&, Response& response) {
      response.success = act(response.message);
      return true;
    });
  };
  const auto map = [&] { return own.param<std::string>("map", ""); };
  const auto save = offer("save_map", [&](std::string& answer) { return revisit->save_map(map(), answer); });
  const auto load = offer("load_map", [&](std::string& answer) { return revisit->load_map(map(), answer); });
  const auto publish = offer("publish_map", [&](std::string& answer) { return revisit->publish_map(answer); });
  ros::AsyncSpinner messages(1), answers(1, &service_queue);
  messages.start();
  answers.start();
  ROS_INFO_STREAM("revisit: waiting for clouds on " << clouds.getTopic());
  while (is_asked_to_end == 0 && ros::ok()) ros::WallDuration(0.05).sleep();
  messages.stop();
  answers.stop();
  const bool is_fine = revisit->finish(message);
  ROS_INFO_STREAM("revisit: " << message);
  ros::shutdown();
  return is_fine ? 0 : 1;
}
