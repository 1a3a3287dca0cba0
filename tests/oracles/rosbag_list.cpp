// SPDX-License-Identifier: Apache-2.0
// What ROS's own library finds in a bag: a line a message, with topic, type, time and a checksum of its bytes; and
// whether its types are those that this ROS knows. For tests alone.
#include <cstdio>
#include <vector>

#include <nav_msgs/Odometry.h>
#include <rosbag/bag.h>
#include <rosbag/view.h>
#include <sensor_msgs/Imu.h>
#include <sensor_msgs/PointCloud2.h>
#include <tf2_msgs/TFMessage.h>
#include <zlib.h>

namespace {

template <typename Message>
bool is_other_version(const rosbag::MessageInstance& message) {
  return message.getDataType() == ros::message_traits::datatype<Message>() && message.instantiate<Message>() == nullptr;
}

}  // namespace

int main(int count, char** arguments) {
  if (count != 2) return 2;
  try {
    rosbag::Bag bag(arguments[1]);
    rosbag::View view(bag);
    for (const rosbag::MessageInstance& message : view) {
      std::vector<std::uint8_t> bytes(message.size());
      ros::serialization::OStream stream(bytes.data(), message.size());
      message.write(stream);
      std::printf("%s %s %llu %08lx\n", message.getTopic().c_str(), message.getDataType().c_str(),
                  static_cast<unsigned long long>(message.getTime().toNSec()), crc32(0, bytes.data(), message.size()));
      if (is_other_version<sensor_msgs::PointCloud2>(message) || is_other_version<sensor_msgs::Imu>(message) ||
          is_other_version<nav_msgs::Odometry>(message) || is_other_version<tf2_msgs::TFMessage>(message))
        return std::printf("other version of %s\n", message.getDataType().c_str()), 1;
    }
  } catch (const std::exception& problem) {
    std::printf("error: %s\n", problem.what());
    return 1;
  }
  return 0;
}
