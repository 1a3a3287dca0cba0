// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <revisit/io/internal/bag.hpp>
#include <revisit/io/internal/bag_frames.hpp>
#include <revisit/io/recording.hpp>

namespace revisit::io_internal {

/// Which topics of a bag are used for what.
struct TopicChoice {
  std::vector<std::size_t> lidars;      ///< all topics of scans or packets
  std::optional<std::size_t> lidar;     ///< the one that was asked for, or the only one
  std::optional<std::size_t> odometry;  ///< likewise
  std::optional<std::size_t> imu;
  Pose T_base_lidar = Pose::Identity();  ///< from the LiDAR to what odometry speaks of
  Eigen::Matrix3d R_lidar_imu = Eigen::Matrix3d::Identity();
  std::optional<Eigen::Vector3f> up;  ///< of a LiDAR that is mounted tilted, as its static transforms say
  std::vector<std::string> notes;     ///< what was left out, and why: a line each
};

/// Errors: a topic that was asked for and is not there.
Result<TopicChoice> choose_topics(const Bag& bag, const RecordingOptions& options);

/// The first message of a topic, its values and the bytes that they lie in.
struct FirstMessage {
  BagMessage message;
  MessageValues values;
};
std::optional<FirstMessage> first_message(const Bag& bag, std::size_t topic);

/// "/points (sensor_msgs/PointCloud2, 300 messages, 10.0 Hz, 16 x 1800 points, frame 'velodyne')".
std::string describe_topic(const Bag& bag, std::size_t topic);
double rate_hz(const Bag& bag, std::size_t topic);

}  // namespace revisit::io_internal
