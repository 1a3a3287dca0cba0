// SPDX-License-Identifier: Apache-2.0
// Where releases of ROS 2 from Humble to Rolling differ, or where rclcpp falls short. Not compiled here (README.md).
#pragma once

#include <charconv>
#include <cstddef>
#include <string>

#if __has_include(<tf2_ros/buffer.hpp>)  // Jazzy and later
#include <tf2_ros/buffer.hpp>
#include <tf2_ros/transform_listener.hpp>
#else
#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_listener.h>
#endif
#include <rclcpp/rclcpp.hpp>

namespace revisit_ros {

/// What is published is kept for subscribers that come later: by DDS, since before Jazzy a publisher within a process
/// cannot, and throws.
template <typename Message, typename Node>
auto create_latched(Node& node, const std::string& topic, std::size_t depth = 1) {
  rclcpp::PublisherOptions options;
  options.use_intra_process_comm = rclcpp::IntraProcessSetting::Disable;
  return rclcpp::create_publisher<Message>(node, topic, rclcpp::QoS(depth).transient_local(), options);
}

/// The value with all its digits: rclcpp writes numbers with six places.
inline std::string text_of(const rclcpp::Parameter& parameter) {
  if (parameter.get_type() != rclcpp::ParameterType::PARAMETER_DOUBLE) return parameter.value_to_string();
  char digits[32];
  return {digits, std::to_chars(digits, digits + sizeof digits, parameter.as_double()).ptr};
}

}  // namespace revisit_ros
