// SPDX-License-Identifier: Apache-2.0
// The node of ROS 2, a lifecycle component. NOT COMPILED BY THIS PROJECT'S TESTS: rclcpp is in no package of Debian 12.
// It is built by hand before a release (README.md). What it calls is the same from Humble to Rolling.
#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <diagnostic_msgs/msg/diagnostic_array.hpp>
#include <geometry_msgs/msg/pose_with_covariance_stamped.hpp>
#include <nav_msgs/msg/odometry.hpp>
#include <nav_msgs/msg/path.hpp>
#include <nav_msgs/srv/get_map.hpp>
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
#include "releases.hpp"
#include "ros_messages.hpp"

namespace revisit_ros {
namespace {

namespace node = revisit::node;

struct Ros2 {
  using Header = std_msgs::msg::Header;
  using Pose = geometry_msgs::msg::Pose;
  using PoseStamped = geometry_msgs::msg::PoseStamped;
  using PoseWithCovariance = geometry_msgs::msg::PoseWithCovariance;
  using StampedPose = geometry_msgs::msg::PoseWithCovarianceStamped;
  using TransformStamped = geometry_msgs::msg::TransformStamped;
  using Path = nav_msgs::msg::Path;
  using Odometry = nav_msgs::msg::Odometry;
  using OccupancyGrid = nav_msgs::msg::OccupancyGrid;
  using Marker = visualization_msgs::msg::Marker;
  using MarkerArray = visualization_msgs::msg::MarkerArray;
  using PointCloud2 = sensor_msgs::msg::PointCloud2;
  using PointField = sensor_msgs::msg::PointField;
  using Imu = sensor_msgs::msg::Imu;
  using NavSatFix = sensor_msgs::msg::NavSatFix;
  using NavSatStatus = sensor_msgs::msg::NavSatStatus;
  using DiagnosticArray = diagnostic_msgs::msg::DiagnosticArray;
  using DiagnosticStatus = diagnostic_msgs::msg::DiagnosticStatus;
  using KeyValue = diagnostic_msgs::msg::KeyValue;
  using Loop = msg::Loop;
  static builtin_interfaces::msg::Time stamp(std::int64_t ns) { return rclcpp::Time(ns); }
  static std::int64_t ns(const builtin_interfaces::msg::Time& stamp) { return rclcpp::Time(stamp).nanoseconds(); }
};
using Messages = node::Messages<Ros2>;
using PointCloud2 = Ros2::PointCloud2;

node::Cloud to_cloud(const PointCloud2::ConstSharedPtr& message) {
  node::Cloud cloud;
  cloud.stamp_ns = Ros2::ns(message->header.stamp);
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

// Another message with a scan (Livox CustomMsg), as it came over the wire.
node::Cloud to_cloud(const std::shared_ptr<rclcpp::SerializedMessage>& message, const std::string& type) {
  node::Cloud cloud;
  cloud.type = type;
  cloud.data = message->get_rcl_serialized_message().buffer;
  cloud.size = message->size();
  cloud.owner = message;
  return cloud;
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
    declare_parameter("cloud_type", "sensor_msgs/msg/PointCloud2");  // or livox_ros_driver2/msg/CustomMsg
    for (const auto& each : node::parameters()) {
      rcl_interfaces::msg::ParameterDescriptor descriptor;
      descriptor.description = each.help;
      descriptor.additional_constraints = each.allowed;
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
    loops_ = rclcpp::create_publisher<Ros2::Loop>(*this, "~/loops", 100);
    loop_poses_ = rclcpp::create_publisher<Ros2::StampedPose>(*this, "~/loop_poses", 100);
    pose_ = rclcpp::create_publisher<Ros2::StampedPose>(*this, "~/pose", 10);
    path_ = create_latched<Ros2::Path>(*this, "~/path");
    graph_ = create_latched<Ros2::MarkerArray>(*this, "~/graph");
    map_ = create_latched<PointCloud2>(*this, "~/map_cloud");
    tiles_.reset();
    tf_ = rclcpp::create_publisher<tf2_msgs::msg::TFMessage>(*this, "/tf", 100);
    diagnostics_ = rclcpp::create_publisher<Ros2::DiagnosticArray>(*this, "/diagnostics", 10);
    node::Settings settings;
    std::string error;
    if (read_settings(settings, error)) node_ = node::Node::make(settings, *this, error);
    if (!node_) RCLCPP_ERROR_STREAM(get_logger(), error);
    on_change_ = add_on_set_parameters_callback([this](const auto& parameters) { return change(parameters); });
    return node_ ? Return::SUCCESS : Return::FAILURE;
  }
  Return on_activate(const State&) override {
    const rclcpp::QoS qos = rclcpp::SensorDataQoS();
    listen<Ros2::Imu>("imu", qos, [this](const Ros2::Imu& m) { node_->add(Messages::imu(m)); });
    listen<Ros2::Odometry>("odom", qos, [this](const Ros2::Odometry& m) { node_->add(Messages::odometry(m)); });
    listen<Ros2::NavSatFix>("fix", qos, [this](const Ros2::NavSatFix& m) {
      if (Messages::is_fix(m)) node_->add(Messages::fix(m));
    });
    listen<Ros2::StampedPose>("initialpose", rclcpp::QoS(1),
                              [this](const Ros2::StampedPose& m) { node_->add(Messages::initial_pose(m)); });
    if (const std::string type = get_parameter("cloud_type").as_string(); type == "sensor_msgs/msg/PointCloud2")
      subscriptions_.push_back(create_subscription<PointCloud2>(
          "points", qos, [this](PointCloud2::ConstSharedPtr m) { node_->add(to_cloud(m)); }));
    else
      subscriptions_.push_back(create_generic_subscription(
          "points", type, qos,
          [this, type](std::shared_ptr<rclcpp::SerializedMessage> m) { node_->add(to_cloud(m, type)); }));
    const auto map = [this] { return get_parameter("map").as_string(); };
    offer("~/save_map", [this, map](std::string& answer) { return node_->save_map(map(), answer); });
    offer("~/load_map", [this, map](std::string& answer) { return node_->load_map(map(), answer); });
    offer("~/publish_map", [this](std::string& answer) { return node_->publish_map(answer); });
    using GetMap = nav_msgs::srv::GetMap;
    services_.push_back(create_service<GetMap>(
        "~/get_map", [this](const std::shared_ptr<GetMap::Request>, const std::shared_ptr<GetMap::Response> response) {
          node::MapGrid grid;
          std::string message;
          if (node_->get_map(grid, message))
            response->map = Messages::grid(std::move(grid), now().nanoseconds());
          else
            log(true, "get_map: " + message);
        }));
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
    loops_->publish(Messages::loop(loop));
    loop_poses_->publish(Messages::pose(loop));
  }
  void send(const node::Frame& frame) override {
    tf2_msgs::msg::TFMessage message;
    message.transforms.push_back(Messages::transform(frame));
    tf_->publish(message);
  }
  void send(const node::MapPose& pose) override { pose_->publish(Messages::pose(pose)); }
  void send(const node::Graph& graph) override {
    path_->publish(Messages::path(graph));
    graph_->publish(Messages::loops(graph));
  }
  void send(const node::MapCloud& cloud) override {
    const std::int64_t now_ns = now().nanoseconds();
    const auto message = [&](const auto& points) {
      return std::make_unique<PointCloud2>(Messages::cloud(cloud.map_frame, points, now_ns));
    };
    map_->publish(message(cloud.overview));
    // A new publisher, which keeps as many messages for those that come later as there are tiles.
    tiles_ = create_latched<PointCloud2>(*this, "~/map_tiles", std::max<std::size_t>(1, cloud.tiles.size()));
    for (const auto& tile : cloud.tiles) tiles_->publish(message(tile));
  }
  void send(const node::Health& health) override {
    diagnostics_->publish(Messages::health(health, get_fully_qualified_name(), now().nanoseconds()));
  }
  bool look_up(const std::string& target, const std::string& source, std::int64_t stamp_ns,
               node::Transform3& T_target_source) override {
    try {
      const tf2::TimePoint stamp{std::chrono::nanoseconds(stamp_ns)};
      const auto found = tf_buffer_.lookupTransform(target, source, stamp).transform;
      T_target_source = Messages::transform(found.translation, found.rotation);
      return true;
    } catch (const tf2::TransformException&) {
      return false;
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
      if (!node::set(settings, name, text_of(get_parameter(name)), error)) return false;
    for (const auto& each : node::parameters())
      if (const std::string text = text_of(get_parameter(each.name)); text != each.value)
        if (!node::set(settings, each.name, text, error)) return false;
    return true;
  }
  // Before they are set; what must stay as it was is refused with the reason.
  rcl_interfaces::msg::SetParametersResult change(const std::vector<rclcpp::Parameter>& parameters) {
    rcl_interfaces::msg::SetParametersResult result;
    node::Settings settings;
    result.successful = true;
    if (!node_) return result;
    result.successful = read_settings(settings, result.reason);
    for (const rclcpp::Parameter& each : parameters)  // others are ROS's own
      if (result.successful && node::is_setting(each.get_name()))
        result.successful = node::set(settings, each.get_name(), text_of(each), result.reason);
    for (const auto& each : node::parameters())  // as read_settings() leaves them out
      if (const auto found = settings.parameters.find(each.name);
          found != settings.parameters.end() && found->second == each.value)
        settings.parameters.erase(found);
    if (result.successful) result.successful = node_->change(settings, result.reason);
    return result;
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
  OnSetParametersCallbackHandle::SharedPtr on_change_;
  rclcpp::Publisher<Ros2::Loop>::SharedPtr loops_;
  rclcpp::Publisher<Ros2::StampedPose>::SharedPtr loop_poses_, pose_;
  rclcpp::Publisher<Ros2::Path>::SharedPtr path_;
  rclcpp::Publisher<Ros2::MarkerArray>::SharedPtr graph_;
  rclcpp::Publisher<PointCloud2>::SharedPtr map_, tiles_;
  rclcpp::Publisher<tf2_msgs::msg::TFMessage>::SharedPtr tf_;
  rclcpp::Publisher<Ros2::DiagnosticArray>::SharedPtr diagnostics_;
  std::vector<rclcpp::SubscriptionBase::SharedPtr> subscriptions_;
  std::vector<rclcpp::ServiceBase::SharedPtr> services_;
  std::unique_ptr<node::Node> node_;  // the last: its thread publishes until it ends
};

}  // namespace revisit_ros

RCLCPP_COMPONENTS_REGISTER_NODE(revisit_ros::RevisitNode)
