// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include <revisit/core/stamps.hpp>
#include <revisit/core/text.hpp>
#include <revisit/io/internal/scan_source.hpp>

namespace revisit::io_internal {
namespace {

class MessageScans final : public ScanSource {
 public:
  MessageScans(std::shared_ptr<const Bag> bag, std::size_t topic, Echo echo, LogSink log)
      : bag_(std::move(bag)), topic_(topic), echo_(echo), log_(std::move(log)) {}

  std::size_t size() const override { return bag_->topics()[topic_].messages; }

  Result<double> log_time_s(std::size_t index) const override {
    const auto message = bag_->read(topic_, index);
    if (!message) return message.error();
    return to_seconds(message->log_time_ns);
  }

  Result<Scan> read(std::size_t index) const override {
    const auto message = bag_->read(topic_, index);
    if (!message) return message.error();
    PointTimes times;
    auto scan = decode(*message, log_, times);
    if (scan && scan->points.empty())
      return Error{name() + ", scan " + std::to_string(index) +
                   ": no usable point: " + std::to_string(scan->dropped_non_finite) + " not finite, " +
                   std::to_string(scan->dropped_at_origin) + " at (0,0,0)"};
    return scan;
  }

  Result<double> stamp_s(std::size_t index) const override {
    const auto message = bag_->read(topic_, index);
    if (!message) return message.error();
    if (bag_->topics()[topic_].type == "velodyne_msgs/VelodyneScan") {  // the first point's
      PointTimes times;
      const auto scan = decode(*message, {}, times);
      if (!scan) return scan.error();
      return scan->stamp_s;
    }
    const auto values = bag_->decode(topic_, *message);
    if (!values) return values.error();
    return stamp_of(*values, *message);
  }

  std::vector<std::string> findings() const override;

 private:
  std::string name() const { return bag_->path().string() + ": " + bag_->topics()[topic_].name; }

  Result<Scan> decode(const BagMessage& message, const LogSink& log, PointTimes& times) const {
    const auto values = bag_->decode(topic_, message);
    if (!values) return values.error();
    return scan_of_message(bag_->topics()[topic_].type, *values, stamp_of(*values, message), echo_, name(), log, times);
  }

  // When it was recorded, where nobody set the stamp. Simulated clocks begin at 0.
  static double stamp_of(const MessageValues& values, const BagMessage& message) {
    constexpr std::int64_t kClocksBegin_ns = 1'000'000'000;
    const std::int64_t stamp_ns = values.stamp_ns();
    return to_seconds(stamp_ns != 0 || message.log_time_ns < kClocksBegin_ns ? stamp_ns : message.log_time_ns);
  }

  std::shared_ptr<const Bag> bag_;
  std::size_t topic_;
  Echo echo_;
  LogSink log_;
};

std::string where_in_sweep(const PointTimes& times) {
  const double sweep_s = times.last_s - times.first_s;
  const double at = -times.first_s / sweep_s;  // of the stamp
  const std::string place = at < 0.1                   ? "the start"
                            : at > 0.9                 ? "the end"
                            : std::abs(at - 0.5) < 0.1 ? "the middle"
                                                       : "within";
  return "stamps: at " + place + " of the sweep (points from " + format("%.4f to %.4f s", times.first_s, times.last_s) +
         ")";
}

std::vector<std::string> MessageScans::findings() const {
  const auto message = size() > 0 ? bag_->read(topic_, 0) : Result<BagMessage>(Error{});
  if (!message) return {};
  PointTimes times;
  const auto scan = decode(*message, {}, times);
  if (!scan) return {scan.error().message};
  if (bag_->topics()[topic_].type == "velodyne_msgs/VelodyneScan")
    return {"packets, decoded by the maker's formulas", "stamps: the first point's"};
  std::vector<std::string> lines;
  const std::string unit = times.unit_s == 1.0 ? "s" : times.unit_s == 1e-3 ? "ms" : times.unit_s == 1e-6 ? "us" : "ns";
  switch (times.meaning) {
    case PointTimes::Meaning::kNone:
      lines.push_back(times.field.empty() ? "point times: none; sweeps are not compensated"
                                          : "point times: field '" + times.field + "' holds none of a sweep");
      break;
    case PointTimes::Meaning::kFromStamp:
      lines.push_back("point times: field '" + times.field + "', " + unit + " from the stamp");
      break;
    case PointTimes::Meaning::kAbsolute:
      lines.push_back("point times: field '" + times.field + "', " + unit + " on the clock of the stamps");
      break;
    case PointTimes::Meaning::kFromFirstPoint:
      lines.push_back("point times: field '" + times.field + "', " + unit +
                      " on another clock than the stamps; the first point is taken to be at the stamp");
      break;
  }
  if (times.meaning != PointTimes::Meaning::kNone) lines.push_back(where_in_sweep(times));
  const double late_s = to_seconds(message->log_time_ns) - scan->stamp_s;
  lines.push_back(std::abs(late_s) < 10.0 ? "recorded " + format("%.3f s after its stamp", late_s)
                                          : "recorded " + format("%.1f s", late_s) +
                                                " after its stamp: on another clock; the stamps are used");
  return lines;
}

}  // namespace

bool holds_packets(const std::string& type) {
  return type == "ouster_ros/PacketMsg" || type == "ouster_sensor_msgs/PacketMsg" || type == "pandar_msgs/PandarScan";
}

Result<std::unique_ptr<ScanSource>> scans_of_messages(std::shared_ptr<const Bag> bag, std::size_t topic, Echo echo,
                                                      const LogSink& log) {
  return std::unique_ptr<ScanSource>(std::make_unique<MessageScans>(std::move(bag), topic, echo, log));
}

}  // namespace revisit::io_internal
