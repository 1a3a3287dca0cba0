// SPDX-License-Identifier: Apache-2.0
#include "rosbag_reader.hpp"

#include <rosbag/bag.h>
#include <rosbag/view.h>
#include <sensor_msgs/PointCloud2.h>

std::size_t read_clouds_with_rosbag(const std::string& file) {
  rosbag::Bag bag(file);
  rosbag::View view(bag, rosbag::TypeQuery("sensor_msgs/PointCloud2"));
  std::size_t bytes = 0;
  for (const rosbag::MessageInstance& message : view)
    bytes += message.instantiate<sensor_msgs::PointCloud2>()->data.size();
  return bytes;
}
