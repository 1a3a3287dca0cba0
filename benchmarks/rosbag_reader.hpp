// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <string>

/// Sum over all clouds of a ROS 1 bag of the bytes of their points, as ROS's own library reads them into messages. A
/// plain function: its headers are C++17.
std::size_t read_clouds_with_rosbag(const std::string& file);
