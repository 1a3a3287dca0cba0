// SPDX-License-Identifier: Apache-2.0
// A node that speaks to ROS 2 without ROS 2: its topics over Cyclone DDS.
#include <atomic>
#include <csignal>
#include <iostream>

#include <CLI/CLI.hpp>

#include "dds_outlet.hpp"

namespace {

using namespace revisit;
using namespace revisit::dds;

struct Topics {
  std::string points = "/points", imu = "/imu", odom = "/odom", fix = "/fix", initial_pose = "/initialpose";
};

node::Cloud to_cloud(const std::shared_ptr<const PointCloud2>& message) {
  node::Cloud cloud;
  cloud.stamp_ns = to_ns(message->header.stamp);
  cloud.frame_id = message->header.frame_id;
  for (std::uint32_t i = 0; i < message->fields._length; ++i) {
    const auto& field = message->fields._buffer[i];
    if (field.count <= 1) cloud.fields.push_back({field.name, field.offset, field.datatype});
  }
  cloud.width = message->width, cloud.height = message->height;
  cloud.point_step = message->point_step, cloud.row_step = message->row_step;
  cloud.is_big_endian = message->is_bigendian;
  cloud.data = message->data._buffer;
  cloud.size = message->data._length;
  cloud.owner = message;
  return cloud;
}

node::Imu to_imu(const ImuMessage& message) {
  const auto vector = [](const geometry_msgs_msg_dds__Vector3_& v) { return Eigen::Vector3d(v.x, v.y, v.z); };
  return {to_ns(message.header.stamp), message.header.frame_id, vector(message.angular_velocity),
          vector(message.linear_acceleration)};
}

node::GpsFix to_fix(const NavSatFix& message) {
  node::GpsFix fix{to_ns(message.header.stamp), message.latitude, message.longitude, message.altitude};
  const auto& covariance = message.position_covariance;
  if (message.position_covariance_type != 0)
    fix.deviation_m = Eigen::Vector3d(covariance[0], covariance[4], covariance[8]).cwiseSqrt();
  return fix;
}

volatile std::sig_atomic_t is_asked_to_end = 0;

int run(const node::Settings& settings, const Topics& topics, const std::string& name, std::uint32_t domain) {
  const dds_entity_t participant = require(dds_create_participant(domain, nullptr, nullptr), "DDS");
  int code = 0;
  {
    DdsOutlet outlet(participant, name);
    std::string message;
    const auto revisit = node::Node::make(settings, outlet, message);
    if (!revisit) {
      std::cerr << "error: " << message << '\n';
      return 1;
    }
    const Reader<ImuMessage> imu(participant, topics.imu, Quality::kSensorData,
                                 [&](const auto& m) { revisit->add(to_imu(*m)); });
    const Reader<OdometryMessage> odometry(participant, topics.odom, Quality::kSensorData, [&](const auto& m) {
      revisit->add(node::Odometry{to_ns(m->header.stamp), m->header.frame_id, m->child_frame_id,
                                  to_transform(&m->pose.pose.position.x, m->pose.pose.orientation)});
    });
    const Reader<NavSatFix> fixes(participant, topics.fix, Quality::kSensorData, [&](const auto& m) {
      if (m->status.status >= 0) revisit->add(to_fix(*m));
    });
    const Reader<PoseWithCovarianceStamped> initial(
        participant, topics.initial_pose, Quality::kReliable, [&](const auto& m) {
          revisit->add(
              node::InitialPose{m->header.frame_id, to_transform(&m->pose.pose.position.x, m->pose.pose.orientation)});
        });
    const Reader<PointCloud2> clouds(participant, topics.points, Quality::kSensorData,
                                     [&](const auto& m) { revisit->add(to_cloud(m)); });
    // Asked for by a thread of DDS, done by this one: clouds come in meanwhile.
    std::atomic<bool> is_asked_to_publish = false, is_asked_to_save = false;
    const Reader<EmptyMessage> publish(participant, name + "/publish_map", Quality::kReliable,
                                       [&](const auto&) { is_asked_to_publish = true; });
    const Reader<EmptyMessage> save(participant, name + "/save_map", Quality::kReliable,
                                    [&](const auto&) { is_asked_to_save = true; });
    std::cerr << "info: waiting for clouds on " << topics.points << '\n';
    while (is_asked_to_end == 0) {
      dds_sleepfor(DDS_MSECS(50));
      if (is_asked_to_publish.exchange(false)) outlet.log(!revisit->publish_map(message), message);
      if (is_asked_to_save.exchange(false)) outlet.log(!revisit->save_map("", message), message);
    }
    if (!revisit->finish(message)) code = 1;
    std::cerr << (code == 0 ? "info: " : "error: ") << message << '\n';
  }
  dds_delete(participant);
  return code;
}

}  // namespace

int main(int argc, char** argv) {
  for (const int signal : {SIGINT, SIGTERM}) std::signal(signal, [](int) { is_asked_to_end = 1; });
  CLI::App app(
      "Places, map or pose from the point clouds of ROS 2, on a machine without ROS 2: speaks to its nodes over "
      "Cyclone "
      "DDS. Ctrl-C ends it; the map is settled and closed.");
  app.footer(
      "Publishes NAME/loops, NAME/loop_poses, NAME/pose, NAME/path, /tf and /diagnostics. A std_msgs/Empty on "
      "NAME/publish_map has the map published (NAME/map_cloud, NAME/map_tiles), one on NAME/save_map has it "
      "written.\n\n"
      "Example: revisit_dds_node --mode slam --map maps/yard --points /ouster/points --imu /ouster/imu");
  revisit::node::Settings settings;
  Topics topics;
  std::string name = "/revisit";
  std::uint32_t domain = 0;
  std::vector<std::string> parameters;
  app.add_option("--mode", settings.mode, "detect, slam or localise")->capture_default_str();
  app.add_option("--map", settings.map, "slam: the folder that keeps the map; localise: the map");
  app.add_flag("--resume", settings.resume, "slam: go on with the map that is there");
  app.add_option("--points", topics.points, "sensor_msgs/PointCloud2")->capture_default_str();
  app.add_option("--imu", topics.imu, "sensor_msgs/Imu; none is fine")->capture_default_str();
  app.add_option("--odom", topics.odom, "nav_msgs/Odometry; none is fine")->capture_default_str();
  app.add_option("--fix", topics.fix, "sensor_msgs/NavSatFix; none is fine")->capture_default_str();
  app.add_option("--map-frame", settings.map_frame, "Frame of the map in tf")->capture_default_str();
  app.add_option("--odom-frame", settings.odom_frame, "Frame of odometry in tf, where its messages name none")
      ->capture_default_str();
  app.add_option("--base-frame", settings.base_frame,
                 "Frame of the robot in tf; /tf_static must say where the LiDAR is on it")
      ->capture_default_str();
  app.add_option("--queue", settings.queue, "Scans that may wait")->capture_default_str();
  app.add_option("--name", name, "Before the names of the topics that it publishes")->capture_default_str();
  app.add_option("--domain", domain, "ROS_DOMAIN_ID")->envname("ROS_DOMAIN_ID")->capture_default_str();
  app.add_option("--set", parameters, "Parameter of the program, e.g. retrieval.top_k=10 (`revisit parameters`)");
  CLI11_PARSE(app, argc, argv);
  for (const std::string& each : parameters) {
    const std::size_t equals = each.find('=');
    if (equals == std::string::npos) {
      std::cerr << "error: --set " << each << ": name=value is wanted\n";
      return 2;
    }
    settings.parameters[each.substr(0, equals)] = each.substr(equals + 1);
  }
  try {
    return run(settings, topics, name, domain);
  } catch (const std::exception& e) {
    std::cerr << "error: " << e.what() << '\n';
    return 1;
  }
}
