// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <revisit/io/internal/message_writer.hpp>

namespace revisit::io_internal {

/// A Livox message as its driver serialises it: 19 bytes a point in ROS 1, 20 in CDR.
inline std::string livox_message(Serialisation how, int points) {
  MessageWriter message(how);
  message.header(1'600'000'000'000'000'000, "livox_frame");
  message.number(std::uint64_t{1'600'000'000'000'000'000});
  message.number(static_cast<std::uint32_t>(points));
  for (int i = 0; i < 4; ++i) message.number(std::uint8_t{0});  // lidar_id, rsvd
  message.number(static_cast<std::uint32_t>(points));
  for (int i = 0; i < points; ++i) {
    message.number(static_cast<std::uint32_t>(i) * 1'000'000);
    for (const float value : {1.f + static_cast<float>(i), 2.f, 3.f}) message.number(value);
    for (const int value : {i % 256, 16, i % 6}) message.number(static_cast<std::uint8_t>(value));
  }
  return message.bytes();
}

/// sensor_msgs/PointCloud2 as ROS 1 serialises it, of float32 fields that lie one behind the other.
inline std::string cloud_message(std::int64_t stamp_ns, const std::string& frame_id,
                                 const std::vector<std::string>& fields, const std::string& data) {
  MessageWriter message(Serialisation::kRos1);
  const auto step = static_cast<std::uint32_t>(4 * fields.size()), size = static_cast<std::uint32_t>(data.size());
  message.header(stamp_ns, frame_id);
  message.number(std::uint32_t{1});
  message.number(size / step);
  message.number(static_cast<std::uint32_t>(fields.size()));
  for (std::uint32_t i = 0; i < fields.size(); ++i) {
    message.text(fields[i]);
    message.number(4 * i);
    message.number(std::uint8_t{7});
    message.number(std::uint32_t{1});
  }
  message.number(std::uint8_t{0});
  message.number(step);
  message.number(size);
  message.block(data);
  message.number(std::uint8_t{1});
  return message.bytes();
}

}  // namespace revisit::io_internal
