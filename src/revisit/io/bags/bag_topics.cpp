// SPDX-License-Identifier: Apache-2.0
#include <revisit/io/bag_topics.hpp>

#include <algorithm>

#include <revisit/core/stamps.hpp>
#include <revisit/io/internal/bag_recording.hpp>
#include <revisit/io/internal/capture.hpp>
#include <revisit/io/internal/topic_choice.hpp>

namespace revisit {
namespace {

using namespace io_internal;

std::string use_of(const Bag& bag, const TopicChoice& choice, std::size_t topic) {
  if (choice.lidar == topic) return "scans";
  if (std::find(choice.lidars.begin(), choice.lidars.end(), topic) != choice.lidars.end())
    return choice.lidar ? "other scans (--topic)" : "scans, one of several: --topic";
  if (choice.odometry == topic) return "odometry";
  if (choice.imu == topic) return "IMU";
  if (bag.topics()[topic].name.ends_with("tf_static")) return "where sensors are mounted";
  return "";
}

Result<std::vector<TopicSummary>> list_bag(const std::filesystem::path& path, const RecordingOptions& options,
                                           const LogSink& log) {
  const auto opened = Bag::open(path, log);
  if (!opened) return opened.error();
  const Bag& bag = **opened;
  const auto choice = choose_topics(bag, options);
  if (!choice) return choice.error();
  std::vector<TopicSummary> topics;
  for (std::size_t i = 0; i < bag.topics().size(); ++i)
    topics.push_back({bag.topics()[i].name, bag.topics()[i].type, bag.topics()[i].messages, rate_hz(bag, i),
                      use_of(bag, *choice, i)});
  return topics;
}

Result<std::vector<TopicSummary>> list_capture(const std::filesystem::path& file, const RecordingOptions& options,
                                               const LogSink& log) {
  const auto streams = open_capture(file, log);
  if (!streams) return streams.error();
  const auto used = lidar_stream(file, *streams, options);
  std::vector<TopicSummary> topics;
  for (std::size_t i = 0; i < streams->size(); ++i) {
    const CapturedStream& stream = (*streams)[i];
    const std::size_t size = stream.packets->size();
    const auto last = stream.packets->read(size - 1);
    const double span_s = last ? to_seconds(last->time_ns - stream.first.time_ns) : 0.0;
    topics.push_back({stream.name, "packets of " + std::to_string(stream.payload_bytes) + " bytes", size,
                      span_s > 0.0 ? static_cast<double>(size - 1) / span_s : 0.0,
                      used && used->index == i ? "scans of a " + used->decoder->sensor() : ""});
  }
  return topics;
}

}  // namespace

bool has_topics(const std::filesystem::path& path) { return is_capture(path) || Bag::is_bag(path); }

Result<std::vector<TopicSummary>> list_topics(const std::filesystem::path& path, const RecordingOptions& options,
                                              const LogSink& log) {
  return is_capture(path) ? list_capture(path, options, log) : list_bag(path, options, log);
}

}  // namespace revisit
