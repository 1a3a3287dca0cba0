// SPDX-License-Identifier: Apache-2.0
#include <revisit/io/scan_message.hpp>

#include <algorithm>
#include <array>
#include <string_view>
#include <utility>

#include <revisit/core/stamps.hpp>
#include <revisit/io/internal/message_values.hpp>
#include <revisit/io/internal/scan_source.hpp>

namespace revisit {
namespace io_internal {
namespace {

constexpr std::string_view kVelodyneScan = "velodyne_msgs/VelodyneScan";

bool is_livox(const std::string& type) { return type.ends_with("/CustomMsg"); }

PointCloudView view_of_cloud(const MessageValues& message) {
  PointCloudView view;
  const auto size = [&](const std::string& path) {
    return static_cast<std::size_t>(std::max<std::int64_t>(0, message.integer(path).value_or(0)));
  };
  for (std::size_t i = 0; i < message.count("fields"); ++i) {
    const std::string field = "fields[" + std::to_string(i) + "].";
    view.fields.push_back({message.text(field + "name"), static_cast<std::uint32_t>(size(field + "offset")),
                           static_cast<std::uint8_t>(size(field + "datatype"))});
  }
  view.width = size("width");
  view.height = size("height");
  view.point_step = size("point_step");
  view.row_step = size("row_step");
  view.is_big_endian = message.number("is_bigendian").value_or(0.0) != 0.0;
  view.data = message.block("data");
  return view;
}

// The points of a Livox message are records too, their fields those that its definition names.
PointCloudView view_of_livox(const MessageValues& message) {
  constexpr std::array<std::uint8_t, 10> kTypes{1, 2, 3, 4, 5, 6, 0, 0, 7, 8};  // of the primitives, in their order
  PointCloudView view;
  view.width = message.count("points");
  view.is_big_endian = message.is_big_endian();
  std::size_t begin = message.bytes().size(), end = 0;
  for (const char* name : {"x", "y", "z", "reflectivity", "line", "offset_time"})
    if (const auto* value = message.find("points." + std::string(name));
        value != nullptr && size_of(value->primitive) > 0) {
      begin = std::min(begin, value->offset);
      end = std::max(end, value->offset + size_of(value->primitive));
      view.point_step = value->stride;
    }
  if (begin >= end) return view;
  if (view.width == 1) view.point_step = end - begin;
  for (const char* name : {"x", "y", "z", "reflectivity", "line", "offset_time"})
    if (const auto* value = message.find("points." + std::string(name));
        value != nullptr && size_of(value->primitive) > 0)
      view.fields.push_back({name, static_cast<std::uint32_t>(value->offset - begin),
                             kTypes[static_cast<std::size_t>(value->primitive)]});
  // The last record may end before its padding does.
  view.row_step = view.width * view.point_step;
  view.data = message.bytes().subspan(begin);
  return view;
}

Result<Scan> scan_of_velodyne(const MessageValues& values, Echo echo, const std::string& what) {
  const auto* data = values.find("packets.data");
  if (data == nullptr || data->primitive != Primitive::kUint8) return Error{what + ": a message without packets"};
  const auto payload = [&](std::size_t i) {
    return values.bytes().subspan(data->offset + i * data->stride, data->count);
  };
  const auto decoder = velodyne_decoder(payload(0), data->messages > 1 ? payload(1) : ByteSpan(), echo);
  if (!decoder) return Error{what + ": " + advice_for_packets(payload(0))};
  PacketPoints points;
  std::int64_t before = decoder->time_ns(payload(0), 0), wrapped = 0;
  const std::int64_t offset = values.stamp_ns("packets.stamp") - before;
  for (std::size_t i = 0; i < data->messages; ++i) {
    if (!decoder->accepts(payload(i))) continue;
    const std::size_t first = points.times_ns.size();
    decoder->decode(payload(i), 0, decoder->parts(), points);
    const std::int64_t now = decoder->time_ns(payload(i), 0);
    if (now < before - decoder->clock_period_ns() / 2) wrapped += decoder->clock_period_ns();
    before = now;
    for (std::size_t j = first; j < points.times_ns.size(); ++j) points.times_ns[j] += wrapped;
  }
  return finish_scan(std::move(points), offset);
}

}  // namespace

Result<Scan> scan_of_message(const std::string& type, const MessageValues& values, double stamp_s, Echo echo,
                             const std::string& what, const LogSink& log, PointTimes& times) {
  if (type == kVelodyneScan) return scan_of_velodyne(values, echo, what);
  return to_scan(is_livox(type) ? view_of_livox(values) : view_of_cloud(values), stamp_s, what, log, &times);
}

bool holds_scans(const std::string& type) {
  return type == "sensor_msgs/PointCloud2" || type == kVelodyneScan || is_livox(type);
}

}  // namespace io_internal

struct ScanMessageReader::Format {
  std::string type;
  io_internal::MessageDefinition definition;
  io_internal::Serialisation serialisation;
};

Result<ScanMessageReader> ScanMessageReader::make(const std::string& type, const std::string& definition,
                                                  bool is_ros1) {
  using namespace io_internal;
  const std::string name = short_type(type);
  if (!holds_scans(name))
    return Error{type + ": holds no scan; sensor_msgs/PointCloud2, Livox CustomMsg and velodyne_msgs/VelodyneScan do"};
  auto parsed = MessageDefinition::parse(name, definition.empty() ? known_definition(name, is_ros1) : definition);
  if (!parsed) return Error{type + ": " + parsed.error().message};
  return ScanMessageReader(std::make_shared<const Format>(
      Format{name, *std::move(parsed), is_ros1 ? Serialisation::kRos1 : Serialisation::kCdr}));
}

Result<ScanMessage> ScanMessageReader::read(std::span<const std::uint8_t> bytes, const std::string& what,
                                            const LogSink& log) const {
  using namespace io_internal;
  const auto values = MessageValues::decode(format_->definition, format_->serialisation, bytes);
  if (!values) return Error{what + ": " + values.error().message};
  ScanMessage message{values->stamp_ns(), values->text("header.frame_id"), {}};
  PointTimes times;
  auto scan = scan_of_message(format_->type, *values, to_seconds(message.stamp_ns), Echo::kStrongest, what, log, times);
  if (!scan) return scan.error();
  if (format_->type == kVelodyneScan) message.stamp_ns = to_nanoseconds(scan->stamp_s);  // the first point's
  message.scan = *std::move(scan);
  return message;
}

}  // namespace revisit
