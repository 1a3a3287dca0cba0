// SPDX-License-Identifier: Apache-2.0
// The node of ROS 2, a lifecycle component. NOT COMPILED BY THIS PROJECT'S TESTS: rclcpp is in no package of Debian 12.
// It is built by hand before a release (README.md). What it calls is the same from Humble to Rolling.
#include <array>
#include <chrono>
#include <cstring>
#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_listener.h>
#include <diagnostic_msgs/msg/diagnostic_array.hpp>
#include <geometry_msgs/msg/pose_with_covariance_stamped.hpp>
#include <nav_msgs/msg/odometry.hpp>
#include <nav_msgs/msg/path.hpp>
#include <rclcpp/rclcpp.hpp>
#include <rclcpp_components/register_node_macro.hpp>
#include <rclcpp_lifecycle/lifecycle_node.hpp>
#include <sensor_msgs/msg/imu.hpp>
#include <sensor_msgs/msg/nav_sat_fix.hpp>
#include <sensor_msgs/msg/point_cloud2.hpp>
#include <std_srvs/srv/trigger.hpp>
#include <tf2_msgs/msg/tf_message.hpp>
#include <visualization_msgs/msg/marker_array.hpp>

#include <revisit_ros/msg/loop.hpp>

#include "node.hpp"

namespace revisit_ros {
namespace {

namespace node = revisit::node;
using geometry_msgs::msg::PoseWithCovarianceStamped;
using sensor_msgs::msg::PointCloud2;

builtin_interfaces::msg::Time to_time(std::int64_t ns) { return rclcpp::Time(ns); }
template <typename Header>
std::int64_t to_ns(const Header& header) {
  return rclcpp::Time(header.stamp).nanoseconds();
}

geometry_msgs::msg::Pose to_pose(const node::Transform3& T) {
  const Eigen::Quaterniond q(T.linear());
  geometry_msgs::msg::Pose pose;
  pose.position.x = T.translation().x(), pose.position.y = T.translation().y(), pose.position.z = T.translation().z();
  pose.orientation.x = q.x(), pose.orientation.y = q.y(), pose.orientation.z = q.z(), pose.orientation.w = q.w();
  return pose;
}
template <typename Position>
node::Transform3 to_transform(const Position& p, const geometry_msgs::msg::Quaternion& q) {
  return node::to_transform({p.x, p.y, p.z}, {q.w, q.x, q.y, q.z});
}
void set_covariance(std::array<double, 36>& values, const Eigen::Matrix<double, 6, 6>& covariance) {
  Eigen::Map<Eigen::Matrix<double, 6, 6>>(values.data()) = covariance;
}

node::Cloud to_cloud(const PointCloud2::ConstSharedPtr& message) {
  node::Cloud cloud;
  cloud.stamp_ns = to_ns(message->header);
  cloud.frame_id = message->header.frame_id;
  for (const auto& field : message->fields)
    if (field.count <= 1) cloud.fields.push_back({field.name, field.offset, field.datatype});
  cloud.width = message->width, cloud.height = message->height;
  cloud.point_step = message->point_step, cloud.row_step = message->row_step;
  cloud.is_big_endian = message->is_bigendian;
  cloud.data = message->data.data();
  cloud.size = message->data.size();
  cloud.owner = message;
  return cloud;
}

node::GpsFix to_fix(const sensor_msgs::msg::NavSatFix& message) {
  node::GpsFix fix{to_ns(message.header), message.latitude, message.longitude, message.altitude};
  const auto& covariance = message.position_covariance;
  if (message.position_covariance_type != sensor_msgs::msg::NavSatFix::COVARIANCE_TYPE_UNKNOWN)
    fix.deviation_m = Eigen::Vector3d(covariance[0], covariance[4], covariance[8]).cwiseSqrt();
  return fix;
}

}  // namespace

class RevisitNode final : public rclcpp_lifecycle::LifecycleNode, public node::Outlet {
 public:
  explicit RevisitNode(const rclcpp::NodeOptions& options)
      : LifecycleNode("revisit", options), tf_buffer_(get_clock()), tf_listener_(tf_buffer_) {
    const node::Settings defaults;
    declare_parameter("mode", defaults.mode);
    declare_parameter("map", defaults.map);
    declare_parameter("resume", defaults.resume);
    declare_parameter("map_frame", defaults.map_frame);
    declare_parameter("odom_frame", defaults.odom_frame);
    declare_parameter("base_frame", defaults.base_frame);
    declare_parameter("queue", static_cast<std::int64_t>(defaults.queue));
    for (const auto& each : node::parameters()) {
      rcl_interfaces::msg::ParameterDescriptor descriptor;
      descriptor.description = each.help;
      descriptor.dynamic_typing = true;  // numbers may be written as such
      declare_parameter(each.name, rclcpp::ParameterValue(each.value), descriptor);
    }
    if (declare_parameter("autostart", true)) {  // once there is somebody to spin it
      start_ = create_wall_timer(std::chrono::milliseconds(1), [this] {
        start_->cancel();
        configure();
        activate();
      });
    }
  }
  ~RevisitNode() override { (void)finish(); }

  using Return = rclcpp_lifecycle::node_interfaces::LifecycleNodeInterface::CallbackReturn;
  using State = rclcpp_lifecycle::State;

  Return on_configure(const State&) override {
    const rclcpp::QoS latched = rclcpp::QoS(1).transient_local();
    loops_ = rclcpp::create_publisher<msg::Loop>(*this, "~/loops", 100);
    loop_poses_ = rclcpp::create_publisher<PoseWithCovarianceStamped>(*this, "~/loop_poses", 100);
    pose_ = rclcpp::create_publisher<PoseWithCovarianceStamped>(*this, "~/pose", 10);
    path_ = rclcpp::create_publisher<nav_msgs::msg::Path>(*this, "~/path", latched);
    graph_ = rclcpp::create_publisher<visualization_msgs::msg::MarkerArray>(*this, "~/graph", latched);
    map_ = rclcpp::create_publisher<PointCloud2>(*this, "~/map_cloud", latched);
    tf_ = rclcpp::create_publisher<tf2_msgs::msg::TFMessage>(*this, "/tf", 100);
    diagnostics_ = rclcpp::create_publisher<diagnostic_msgs::msg::DiagnosticArray>(*this, "/diagnostics", 10);
    node::Settings settings;
    std::string error;
    if (read_settings(settings, error)) node_ = node::Node::make(settings, *this, error);
    if (!node_) RCLCPP_ERROR_STREAM(get_logger(), error);
    return node_ ? Return::SUCCESS : Return::FAILURE;
  }
  Return on_activate(const State&) override {
    const rclcpp::QoS qos = rclcpp::SensorDataQoS();
    listen<sensor_msgs::msg::Imu>("imu", qos, [this](const sensor_msgs::msg::Imu& m) {
      const auto vector = [](const auto& v) { return Eigen::Vector3d(v.x, v.y, v.z); };
      node_->add(
          node::Imu{to_ns(m.header), m.header.frame_id, vector(m.angular_velocity), vector(m.linear_acceleration)});
    });
    listen<nav_msgs::msg::Odometry>("odom", qos, [this](const nav_msgs::msg::Odometry& m) {
      node_->add(node::Odometry{to_ns(m.header), m.header.frame_id, m.child_frame_id,
                                to_transform(m.pose.pose.position, m.pose.pose.orientation)});
    });
    listen<sensor_msgs::msg::NavSatFix>("fix", qos, [this](const sensor_msgs::msg::NavSatFix& m) {
      if (m.status.status >= sensor_msgs::msg::NavSatStatus::STATUS_FIX) node_->add(to_fix(m));
    });
    listen<PoseWithCovarianceStamped>("initialpose", rclcpp::QoS(1), [this](const PoseWithCovarianceStamped& m) {
      node_->add(node::InitialPose{m.header.frame_id, to_transform(m.pose.pose.position, m.pose.pose.orientation)});
    });
    subscriptions_.push_back(create_subscription<PointCloud2>(
        "points", qos, [this](PointCloud2::ConstSharedPtr m) { node_->add(to_cloud(m)); }));
    const auto map = [this] { return get_parameter("map").as_string(); };
    offer("~/save_map", [this, map](std::string& answer) { return node_->save_map(map(), answer); });
    offer("~/load_map", [this, map](std::string& answer) { return node_->load_map(map(), answer); });
    offer("~/publish_map", [this](std::string& answer) { return node_->publish_map(answer); });
    return Return::SUCCESS;
  }
  Return on_deactivate(const State&) override {
    subscriptions_.clear();
    services_.clear();
    return Return::SUCCESS;
  }
  Return on_cleanup(const State&) override { return finish() ? Return::SUCCESS : Return::FAILURE; }
  Return on_shutdown(const State&) override { return finish() ? Return::SUCCESS : Return::FAILURE; }

  void send(const node::Loop& loop) override {
    msg::Loop message;
    message.header.stamp = to_time(loop.query_stamp_ns);
    message.header.frame_id = loop.lidar_frame;
    message.match_stamp = to_time(loop.match_stamp_ns);
    message.query = loop.query, message.match = loop.match;
    message.t_match_query.pose = to_pose(loop.T_match_query);
    set_covariance(message.t_match_query.covariance, loop.covariance);
    message.probability = loop.probability;
    loops_->publish(message);
    PoseWithCovarianceStamped geometry;
    geometry.header = message.header;
    geometry.pose = message.t_match_query;
    set_covariance(geometry.pose.covariance, loop.covariance_about_match);
    loop_poses_->publish(geometry);
  }
  void send(const node::Frame& frame) override {
    geometry_msgs::msg::TransformStamped one;
    one.header.stamp = to_time(frame.stamp_ns);
    one.header.frame_id = frame.parent;
    one.child_frame_id = frame.child;
    const geometry_msgs::msg::Pose pose = to_pose(frame.T_parent_child);
    one.transform.translation.x = pose.position.x, one.transform.translation.y = pose.position.y;
    one.transform.translation.z = pose.position.z;
    one.transform.rotation = pose.orientation;
    tf2_msgs::msg::TFMessage message;
    message.transforms.push_back(one);
    tf_->publish(message);
  }
  void send(const node::MapPose& pose) override {
    PoseWithCovarianceStamped message;
    message.header.stamp = to_time(pose.stamp_ns);
    message.header.frame_id = pose.map_frame;
    message.pose.pose = to_pose(pose.T_map_lidar);
    set_covariance(message.pose.covariance, pose.covariance);
    pose_->publish(message);
  }
  void send(const node::Graph& graph) override {
    nav_msgs::msg::Path path;
    path.header.frame_id = graph.map_frame;
    if (!graph.path.empty()) path.header.stamp = to_time(graph.path.back().first);
    for (const auto& [stamp_ns, T] : graph.path) {
      geometry_msgs::msg::PoseStamped pose;
      pose.header.frame_id = graph.map_frame;
      pose.header.stamp = to_time(stamp_ns);
      pose.pose = to_pose(T);
      path.poses.push_back(pose);
    }
    visualization_msgs::msg::Marker lines;
    lines.header = path.header;
    lines.ns = "loops";
    lines.type = visualization_msgs::msg::Marker::LINE_LIST;
    lines.pose.orientation.w = 1.0;
    lines.scale.x = 0.1;
    lines.color.r = 0.84f, lines.color.g = 0.37f, lines.color.a = 1.f;
    for (const auto& [from, to] : graph.loops)
      for (const std::size_t end : {from, to}) lines.points.push_back(path.poses[end].pose.position);
    visualization_msgs::msg::MarkerArray markers;
    markers.markers.push_back(lines);
    path_->publish(path);
    graph_->publish(markers);
  }
  void send(const node::MapCloud& cloud) override {
    auto message = std::make_unique<PointCloud2>();
    message->header.frame_id = cloud.map_frame;
    message->header.stamp = now();
    const std::string names[] = {"x", "y", "z", "intensity"};
    for (std::uint32_t i = 0; i < 4; ++i) {
      sensor_msgs::msg::PointField field;
      field.name = names[i], field.offset = 4 * i, field.count = 1;
      field.datatype = sensor_msgs::msg::PointField::FLOAT32;
      message->fields.push_back(field);
    }
    message->height = 1;
    message->width = static_cast<std::uint32_t>(cloud.points.size() / 4);
    message->point_step = 16;
    message->row_step = 16 * message->width;
    message->is_dense = true;
    message->data.resize(message->row_step);
    std::memcpy(message->data.data(), cloud.points.data(), message->data.size());
    map_->publish(std::move(message));
  }
  void send(const node::Health& health) override {
    diagnostic_msgs::msg::DiagnosticStatus status;
    status.name = get_fully_qualified_name();
    status.level = static_cast<std::uint8_t>(health.level);
    status.message = health.message;
    for (const auto& [key, value] : health.values) {
      diagnostic_msgs::msg::KeyValue pair;
      pair.key = key, pair.value = value;
      status.values.push_back(pair);
    }
    diagnostic_msgs::msg::DiagnosticArray message;
    message.header.stamp = now();
    message.status.push_back(status);
    diagnostics_->publish(message);
  }
  // tf2's own wait goes by the simulated clock, which may stand still.
  bool look_up(const std::string& target, const std::string& source, std::int64_t stamp_ns, bool may_wait,
               node::Transform3& T_target_source) override {
    const tf2::TimePoint stamp{std::chrono::nanoseconds(stamp_ns)};
    for (int tries = may_wait ? 10 : 0;; --tries) {
      try {
        const auto found = tf_buffer_.lookupTransform(target, source, stamp).transform;
        T_target_source = to_transform(found.translation, found.rotation);
        return true;
      } catch (const tf2::TransformException&) {
        if (tries <= 0) return false;
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
      }
    }
  }
  void log(bool is_warning, const std::string& text) override {
    if (is_warning)
      RCLCPP_WARN_STREAM(get_logger(), text);
    else
      RCLCPP_INFO_STREAM(get_logger(), text);
  }

 private:
  bool read_settings(node::Settings& settings, std::string& error) {
    for (const char* name : {"mode", "map", "resume", "map_frame", "odom_frame", "base_frame", "queue"})
      if (!node::set(settings, name, get_parameter(name).value_to_string(), error)) return false;
    for (const auto& each : node::parameters())
      if (const std::string text = get_parameter(each.name).value_to_string(); text != each.value)
        if (!node::set(settings, each.name, text, error)) return false;
    return true;
  }
  template <typename Message, typename Use>
  void listen(const std::string& topic, const rclcpp::QoS& qos, Use use) {
    subscriptions_.push_back(
        create_subscription<Message>(topic, qos, [use](const typename Message::ConstSharedPtr m) { use(*m); }));
  }
  void offer(const std::string& name, std::function<bool(std::string&)> act) {
    using Service = std_srvs::srv::Trigger;
    services_.push_back(create_service<Service>(
        name, [act](const std::shared_ptr<Service::Request>, const std::shared_ptr<Service::Response> response) {
          response->success = act(response->message);
        }));
  }
  // The scans that wait are worked on, and nothing is lost.
  bool finish() {
    subscriptions_.clear();
    services_.clear();
    std::string message;
    const bool is_fine = !node_ || node_->finish(message);
    if (node_) RCLCPP_INFO_STREAM(get_logger(), message);
    node_.reset();
    return is_fine;
  }

  tf2_ros::Buffer tf_buffer_;
  tf2_ros::TransformListener tf_listener_;
  rclcpp::TimerBase::SharedPtr start_;
  rclcpp::Publisher<msg::Loop>::SharedPtr loops_;
  rclcpp::Publisher<PoseWithCovarianceStamped>::SharedPtr loop_poses_, pose_;
  rclcpp::Publisher<nav_msgs::msg::Path>::SharedPtr path_;
  rclcpp::Publisher<visualization_msgs::msg::MarkerArray>::SharedPtr graph_;
  rclcpp::Publisher<PointCloud2>::SharedPtr map_;
  rclcpp::Publisher<tf2_msgs::msg::TFMessage>::SharedPtr tf_;
  rclcpp::Publisher<diagnostic_msgs::msg::DiagnosticArray>::SharedPtr diagnostics_;
  std::vector<rclcpp::SubscriptionBase::SharedPtr> subscriptions_;
  std::vector<rclcpp::ServiceBase::SharedPtr> services_;
  std::unique_ptr<node::Node> node_;  // the last: its thread publishes until it ends
};

}  // namespace revisit_ros

RCLCPP_COMPONENTS_REGISTER_NODE(revisit_ros::RevisitNode)
