// SPDX-License-Identifier: Apache-2.0
#include <revisit/io/internal/topic_choice.hpp>

#include <algorithm>

#include <revisit/core/stamps.hpp>
#include <revisit/core/text.hpp>
#include <revisit/io/internal/scan_source.hpp>

namespace revisit::io_internal {
namespace {

// Packets of an Ouster's IMU come as the same type as those of its LiDAR.
bool holds_small_packets(const Bag& bag, std::size_t topic) {
  constexpr std::size_t kLeastLidarPacket = 1000;
  const auto first = first_message(bag, topic);
  return first && first->values.find("buf") != nullptr && first->values.block("buf").size() < kLeastLidarPacket;
}

std::vector<std::size_t> lidars_of(const Bag& bag) {
  std::vector<std::size_t> lidars;
  for (std::size_t i = 0; i < bag.topics().size(); ++i) {
    const BagTopic& topic = bag.topics()[i];
    if (topic.messages == 0 || !(holds_scans(topic.type) || holds_packets(topic.type))) continue;
    if (!holds_small_packets(bag, i)) lidars.push_back(i);
  }
  return lidars;
}

std::vector<std::size_t> topics_of(const Bag& bag, std::string_view type) {
  std::vector<std::size_t> found;
  for (std::size_t i = 0; i < bag.topics().size(); ++i)
    if (bag.topics()[i].type == type && bag.topics()[i].messages > 0) found.push_back(i);
  return found;
}

std::string names(const Bag& bag, const std::vector<std::size_t>& topics) {
  std::string text;
  for (const std::size_t topic : topics) text += (text.empty() ? "" : ", ") + bag.topics()[topic].name;
  return text;
}

std::string text_of_first(const Bag& bag, std::size_t topic, const std::string& path) {
  const auto first = first_message(bag, topic);
  return first ? first->values.text(path) : std::string();
}

Result<std::optional<std::size_t>> asked_for(const Bag& bag, const std::vector<std::size_t>& topics,
                                             const std::string& name, const std::string& what) {
  if (name.empty()) return topics.size() == 1 ? std::optional(topics[0]) : std::nullopt;
  for (const std::size_t topic : topics)
    if (bag.topics()[topic].name == name || bag.topics()[topic].name == "/" + name) return std::optional(topic);
  return Error{bag.path().string() + ": no topic '" + name + "' of " + what +
               (topics.empty() ? "; the bag has none" : "; there are: " + names(bag, topics))};
}

Status choose_odometry(const Bag& bag, const RecordingOptions& options, const StaticFrames& frames,
                       const std::string& lidar_frame, TopicChoice& choice) {
  if (options.odometry_topic == "none") return ok();
  const std::vector<std::size_t> topics = topics_of(bag, "nav_msgs/Odometry");
  const auto chosen = asked_for(bag, topics, options.odometry_topic, "odometry");
  if (!chosen) return chosen.error();
  if (!*chosen && topics.size() > 1)
    choice.notes.push_back("odometry: several topics (" + names(bag, topics) +
                           "); none is used unless --odometry-topic names one");
  if (!*chosen) return ok();
  const std::string body = text_of_first(bag, **chosen, "child_frame_id");
  if (const auto T = frames.between(body, lidar_frame)) {
    choice.T_base_lidar = *T;
  } else if (options.odometry_topic.empty()) {
    choice.notes.push_back("odometry: " + bag.topics()[**chosen].name + " is left out: no static transform joins '" +
                           body + "' and the LiDAR's frame '" + lidar_frame +
                           "'; --odometry-topic takes it as the LiDAR's own");
    return ok();
  } else {
    choice.notes.push_back("odometry: no static transform joins '" + body + "' and the LiDAR's frame '" + lidar_frame +
                           "'; taken as the LiDAR's own");
  }
  choice.odometry = *chosen;
  return ok();
}

// The first IMU whose orientation to the LiDAR is known.
void choose_imu(const Bag& bag, const StaticFrames& frames, const std::string& lidar_frame, TopicChoice& choice) {
  const std::vector<std::size_t> topics = topics_of(bag, "sensor_msgs/Imu");
  for (const std::size_t topic : topics) {
    const auto T = frames.between(lidar_frame, text_of_first(bag, topic, "header.frame_id"));
    if (!T) continue;
    choice.imu = topic;
    choice.R_lidar_imu = T->linear();
    return;
  }
  if (!topics.empty())
    choice.notes.push_back("IMU: " + names(bag, topics) + " left out: no static transform joins '" +
                           text_of_first(bag, topics[0], "header.frame_id") + "' and the LiDAR's frame '" +
                           lidar_frame + "'");
}

// A robot's base stands upright; a LiDAR that leans against it by more than cars do on a slope says so.
void find_mounting(const StaticFrames& frames, const std::string& lidar_frame, TopicChoice& choice) {
  for (const char* base : {"base_link", "base_footprint", "base"}) {
    const auto T = frames.between(lidar_frame, base);
    if (!T) continue;
    constexpr double kUpright_deg = 8.0;
    const Eigen::Vector3d up = T->linear() * Eigen::Vector3d::UnitZ();
    const double tilt_deg = to_degrees(std::acos(std::clamp(up.z(), -1.0, 1.0)));
    if (tilt_deg < kUpright_deg) return;
    choice.up = up.cast<float>();
    choice.notes.push_back("mounting: the LiDAR is tilted by " + format("%.0f degrees", tilt_deg) + " against '" +
                           base + "', as the static transforms say; scans are set upright");
    return;
  }
}

}  // namespace

std::optional<FirstMessage> first_message(const Bag& bag, std::size_t topic) {
  if (bag.topics()[topic].messages == 0) return std::nullopt;
  auto message = bag.read(topic, 0);
  if (!message) return std::nullopt;
  auto values = bag.decode(topic, *message);
  if (!values) return std::nullopt;
  return FirstMessage{*std::move(message), *std::move(values)};
}

double rate_hz(const Bag& bag, std::size_t topic) {
  const std::uint64_t messages = bag.topics()[topic].messages;
  if (messages < 2) return 0.0;
  const auto first = bag.read(topic, 0), last = bag.read(topic, messages - 1);
  const double span_s = first && last ? to_seconds(last->log_time_ns - first->log_time_ns) : 0.0;
  return span_s > 0.0 ? static_cast<double>(messages - 1) / span_s : 0.0;
}

std::string describe_topic(const Bag& bag, std::size_t topic) {
  const BagTopic& facts = bag.topics()[topic];
  std::string text = facts.name + " (" + facts.type + ", " + std::to_string(facts.messages) + " messages";
  if (const double rate = rate_hz(bag, topic); rate > 0.0) text += format(", %.1f Hz", rate);
  if (const auto first = first_message(bag, topic)) {
    if (const auto width = first->values.integer("width"), height = first->values.integer("height"); width && height)
      text += ", " + std::to_string(*width * *height) + " points";
    if (const auto points = first->values.count("points"); points > 0)
      text += ", " + std::to_string(points) + " points";
    if (const std::string frame = first->values.text("header.frame_id"); !frame.empty())
      text += ", frame '" + frame + "'";
  }
  return text + ")";
}

Result<TopicChoice> choose_topics(const Bag& bag, const RecordingOptions& options) {
  TopicChoice choice;
  choice.lidars = lidars_of(bag);
  const auto lidar = asked_for(bag, choice.lidars, options.topic, "scans");
  if (!lidar) return lidar.error();
  choice.lidar = *lidar;
  if (!choice.lidar) return choice;
  const StaticFrames frames = static_frames_of(bag);
  const std::string lidar_frame = text_of_first(bag, *choice.lidar, "header.frame_id");
  if (const Status status = choose_odometry(bag, options, frames, lidar_frame, choice); !status) return status.error();
  if (options.use_imu) choose_imu(bag, frames, lidar_frame, choice);
  find_mounting(frames, lidar_frame, choice);
  return choice;
}

}  // namespace revisit::io_internal
