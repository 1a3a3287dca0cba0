// SPDX-License-Identifier: Apache-2.0
// The node of ROS 1. C++17, as the message headers are: it hands messages on, and nothing else.
#include <algorithm>
#include <csignal>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include <diagnostic_msgs/DiagnosticArray.h>
#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <nav_msgs/GetMap.h>
#include <nav_msgs/Odometry.h>
#include <nav_msgs/Path.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <sensor_msgs/Imu.h>
#include <sensor_msgs/NavSatFix.h>
#include <sensor_msgs/PointCloud2.h>
#include <std_srvs/Trigger.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_broadcaster.h>
#include <tf2_ros/transform_listener.h>
#include <topic_tools/shape_shifter.h>
#include <visualization_msgs/MarkerArray.h>

#include <revisit_ros/Loop.h>

#include "node.hpp"
#include "ros_messages.hpp"

namespace {

namespace node = revisit::node;

struct Ros1 {
  using Header = std_msgs::Header;
  using Pose = geometry_msgs::Pose;
  using PoseStamped = geometry_msgs::PoseStamped;
  using PoseWithCovariance = geometry_msgs::PoseWithCovariance;
  using StampedPose = geometry_msgs::PoseWithCovarianceStamped;
  using TransformStamped = geometry_msgs::TransformStamped;
  using Path = nav_msgs::Path;
  using Odometry = nav_msgs::Odometry;
  using OccupancyGrid = nav_msgs::OccupancyGrid;
  using Marker = visualization_msgs::Marker;
  using MarkerArray = visualization_msgs::MarkerArray;
  using PointCloud2 = sensor_msgs::PointCloud2;
  using PointField = sensor_msgs::PointField;
  using Imu = sensor_msgs::Imu;
  using NavSatFix = sensor_msgs::NavSatFix;
  using NavSatStatus = sensor_msgs::NavSatStatus;
  using DiagnosticArray = diagnostic_msgs::DiagnosticArray;
  using DiagnosticStatus = diagnostic_msgs::DiagnosticStatus;
  using KeyValue = diagnostic_msgs::KeyValue;
  using Loop = revisit_ros::Loop;
  static ros::Time stamp(std::int64_t ns) {
    return {static_cast<std::uint32_t>(ns / 1'000'000'000), static_cast<std::uint32_t>(ns % 1'000'000'000)};
  }
  static std::int64_t ns(const ros::Time& time) { return static_cast<std::int64_t>(time.toNSec()); }
  static std::int64_t now_ns() { return ns(ros::Time::now()); }
};
using Messages = node::Messages<Ros1>;

class Outlet final : public node::Outlet {
 public:
  explicit Outlet(ros::NodeHandle& handle) : listener_(buffer_), handle_(handle) {
    loops_ = handle.advertise<Ros1::Loop>("loops", 100);
    loop_poses_ = handle.advertise<Ros1::StampedPose>("loop_poses", 100);
    pose_ = handle.advertise<Ros1::StampedPose>("pose", 10);
    path_ = handle.advertise<Ros1::Path>("path", 1, true);
    graph_ = handle.advertise<Ros1::MarkerArray>("graph", 1, true);
    map_ = handle.advertise<Ros1::PointCloud2>("map_cloud", 1, true);
    diagnostics_ = handle.advertise<Ros1::DiagnosticArray>("/diagnostics", 10);
  }

  void send(const node::Loop& loop) override {
    loops_.publish(Messages::loop(loop));
    loop_poses_.publish(Messages::pose(loop));
  }
  void send(const node::Frame& frame) override { broadcaster_.sendTransform(Messages::transform(frame)); }
  void send(const node::MapPose& pose) override { pose_.publish(Messages::pose(pose)); }
  void send(const node::Graph& graph) override {
    path_.publish(Messages::path(graph));
    graph_.publish(Messages::loops(graph));
  }
  void send(const node::MapCloud& cloud) override {
    const std::int64_t now_ns = Ros1::now_ns();
    map_.publish(Messages::cloud(cloud.map_frame, cloud.overview, now_ns));
    // A publisher keeps its last message for those that come later: one a tile, and no limit to what they send at once.
    tiles_.resize(cloud.tiles.size());
    for (std::size_t i = 0; i < tiles_.size(); ++i) {
      if (!tiles_[i]) tiles_[i] = handle_.advertise<Ros1::PointCloud2>("map_tiles", 0, true);
      tiles_[i].publish(Messages::cloud(cloud.map_frame, cloud.tiles[i], now_ns));
    }
  }
  void send(const node::Health& health) override {
    diagnostics_.publish(Messages::health(health, ros::this_node::getName(), Ros1::now_ns()));
  }
  bool look_up(const std::string& target, const std::string& source, std::int64_t stamp_ns,
               node::Transform3& T_target_source) override {
    try {
      const auto found = buffer_.lookupTransform(target, source, Ros1::stamp(stamp_ns)).transform;
      T_target_source = Messages::transform(found.translation, found.rotation);
      return true;
    } catch (const tf2::TransformException&) {
      return false;
    }
  }
  void log(bool is_warning, const std::string& text) override {
    ROS_LOG_STREAM(is_warning ? ros::console::levels::Warn : ros::console::levels::Info, ROSCONSOLE_DEFAULT_NAME, text);
  }

 private:
  tf2_ros::Buffer buffer_;
  tf2_ros::TransformListener listener_;
  tf2_ros::TransformBroadcaster broadcaster_;
  ros::NodeHandle handle_;
  ros::Publisher loops_, loop_poses_, pose_, path_, graph_, map_, diagnostics_;
  std::vector<ros::Publisher> tiles_;
};

// Whatever message with a scan a driver sends, as it came over the wire: its package need not be installed.
node::Cloud to_cloud(const topic_tools::ShapeShifter::ConstPtr& message) {
  node::Cloud cloud;
  cloud.type = message->getDataType();
  cloud.definition = message->getMessageDefinition();
  cloud.is_ros1 = true;
  const auto bytes = std::make_shared<std::vector<std::uint8_t>>(message->size());
  ros::serialization::OStream stream(bytes->data(), message->size());
  message->write(stream);
  cloud.data = bytes->data();
  cloud.size = bytes->size();
  cloud.owner = bytes;
  return cloud;
}

bool answer_map(node::Node& revisit, Ros1::OccupancyGrid& map) {
  node::MapGrid grid;
  std::string message;
  const bool is_there = revisit.get_map(grid, message);
  if (is_there)
    map = Messages::grid(std::move(grid), Ros1::now_ns());
  else
    ROS_WARN_STREAM("revisit: get_map: " << message);
  return is_there;
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
  using Any = topic_tools::ShapeShifter;
  const auto clouds =
      handle.subscribe<Any>("points", kClouds, [&](const Any::ConstPtr& cloud) { revisit->add(to_cloud(cloud)); });
  const auto imu = handle.subscribe<Ros1::Imu>("imu", kSmall,
                                               [&](const Ros1::Imu::ConstPtr& m) { revisit->add(Messages::imu(*m)); });
  const auto odometry = handle.subscribe<Ros1::Odometry>(
      "odom", kSmall, [&](const Ros1::Odometry::ConstPtr& m) { revisit->add(Messages::odometry(*m)); });
  const auto fixes = handle.subscribe<Ros1::NavSatFix>("fix", kSmall, [&](const Ros1::NavSatFix::ConstPtr& m) {
    if (Messages::is_fix(*m)) revisit->add(Messages::fix(*m));
  });
  const auto initial = handle.subscribe<Ros1::StampedPose>(
      "initialpose", 1, [&](const Ros1::StampedPose::ConstPtr& m) { revisit->add(Messages::initial_pose(*m)); });
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
  const auto change = offer("update_parameters", [&](std::string& answer) {
    node::Settings asked;
    return read_settings(own, asked, answer) && revisit->change(asked, answer);
  });
  using MapRequest = nav_msgs::GetMap::Request;
  using MapResponse = nav_msgs::GetMap::Response;
  const auto get = services.advertiseService<MapRequest, MapResponse>(
      "get_map", [&](MapRequest&, MapResponse& response) { return answer_map(*revisit, response.map); });
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
