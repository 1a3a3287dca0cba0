// SPDX-License-Identifier: Apache-2.0
#include <revisit/io/bag_writer.hpp>

#include <algorithm>

#include <revisit/core/stamps.hpp>
#include <revisit/core/text.hpp>
#include <revisit/io/internal/bag_file_writer.hpp>
#include <revisit/io/internal/byte_buffer.hpp>
#include <revisit/io/internal/message_writer.hpp>

namespace revisit {

using io_internal::MessageWriter;

namespace {

void write_vector(MessageWriter& message, const Eigen::Vector3d& v) {
  for (int i = 0; i < 3; ++i) message.number(v[i]);
}
void write_rotation(MessageWriter& message, const Pose& T) {
  const Eigen::Quaterniond q(T.linear());
  for (const double value : {q.x(), q.y(), q.z(), q.w()}) message.number(value);
}
void write_zeros(MessageWriter& message, int count) {
  for (int i = 0; i < count; ++i) message.number(0.0);
}

struct WrittenField {
  const char* name;
  std::uint8_t type;
  std::uint32_t bytes;
};

}  // namespace

BagWriter::BagWriter(std::unique_ptr<io_internal::BagFileWriter> file) : file_(std::move(file)) {}
BagWriter::BagWriter(BagWriter&&) noexcept = default;
BagWriter& BagWriter::operator=(BagWriter&&) noexcept = default;
BagWriter::~BagWriter() = default;

Result<BagWriter> BagWriter::create(const std::filesystem::path& file) {
  std::error_code failure;
  if (std::filesystem::exists(file, failure)) return Error{file.string() + ": exists already; name a new file"};
  const std::string extension = file.extension().string();
  if (extension != ".bag" && extension != ".mcap" && extension != ".db3")
    return Error{file.string() + ": bags end in .bag, .mcap or .db3"};
  auto writer = extension == ".bag"    ? io_internal::create_ros1_bag(file)
                : extension == ".mcap" ? io_internal::create_mcap(file)
                                       : io_internal::create_db3(file);
  if (!writer) return writer.error();
  return BagWriter(*std::move(writer));
}

Status BagWriter::write(const std::string& topic, const std::string& type, std::int64_t log_time_ns,
                        const std::string& message) {
  if (log_time_ns < 0)
    return Error{topic + ": a message of " + format("%.3f", to_seconds(log_time_ns)) +
                 " s; the clock of ROS begins at 0"};
  auto found = topics_.find(topic);
  if (found == topics_.end()) {
    if (const Status status = file_->add_topic(topic, type); !status) return status;
    found = topics_.emplace(topic, topics_.size()).first;
  }
  return file_->write(found->second, log_time_ns, message);
}

Status BagWriter::write_scan(const std::string& topic, const std::string& frame_id, const Scan& scan) {
  require_consistent(scan);
  constexpr std::uint8_t kUint16 = 4, kFloat32 = 7;
  std::vector<WrittenField> fields{
      {"x", kFloat32, 4}, {"y", kFloat32, 4}, {"z", kFloat32, 4}, {"intensity", kFloat32, 4}};
  if (!scan.rings.empty()) fields.push_back({"ring", kUint16, 2});
  if (!scan.times_s.empty()) fields.push_back({"time", kFloat32, 4});
  io_internal::ByteBuffer points;
  for (std::size_t i = 0; i < scan.points.size(); ++i) {
    points.raw({reinterpret_cast<const char*>(&scan.points[i]), sizeof(Point)});
    if (!scan.rings.empty()) points.number(scan.rings[i]);
    if (!scan.times_s.empty()) points.number(scan.times_s[i]);
  }
  MessageWriter message(file_->serialisation());
  message.header(to_nanoseconds(scan.stamp_s), frame_id);
  message.number(std::uint32_t{1});
  message.number(static_cast<std::uint32_t>(scan.points.size()));
  message.number(static_cast<std::uint32_t>(fields.size()));
  std::uint32_t offset = 0;
  for (const WrittenField& field : fields) {
    message.text(field.name);
    message.number(offset);
    message.number(field.type);
    message.number(std::uint32_t{1});
    offset += field.bytes;
  }
  message.number(std::uint8_t{0});
  message.number(offset);
  message.number(static_cast<std::uint32_t>(points.size()));
  message.block(points.bytes());
  message.number(std::uint8_t{1});
  const double end_s = scan.times_s.empty() ? 0.0 : *std::max_element(scan.times_s.begin(), scan.times_s.end());
  return write(topic, "sensor_msgs/PointCloud2", to_nanoseconds(scan.stamp_s + end_s), message.bytes());
}

Status BagWriter::write_imu(const std::string& topic, const std::string& frame_id, double stamp_s,
                            const ImuSample& sample) {
  const std::int64_t time_ns = to_nanoseconds(stamp_s + sample.time_s);
  MessageWriter message(file_->serialisation());
  message.header(time_ns, frame_id);
  for (const double value : {0.0, 0.0, 0.0, 1.0}) message.number(value);
  message.number(-1.0);  // no orientation
  write_zeros(message, 8);
  write_vector(message, sample.angular_radps.cast<double>());
  write_zeros(message, 9);
  write_vector(message, sample.acceleration_mps2.cast<double>());
  write_zeros(message, 9);
  return write(topic, "sensor_msgs/Imu", time_ns, message.bytes());
}

Status BagWriter::write_fix(const std::string& topic, const std::string& frame_id, const GpsFix& fix) {
  MessageWriter message(file_->serialisation());
  message.header(to_nanoseconds(fix.stamp_s), frame_id);
  message.number(std::int8_t{0});    // status: a fix
  message.number(std::uint16_t{1});  // service: GPS
  for (const double value : {fix.latitude_deg, fix.longitude_deg, fix.altitude_m}) message.number(value);
  for (int i = 0; i < 9; ++i) message.number(i % 4 == 0 ? std::pow(fix.deviation_m[i / 4], 2) : 0.0);
  message.number(std::uint8_t{2});  // type of covariance: its diagonal is known
  return write(topic, "sensor_msgs/NavSatFix", to_nanoseconds(fix.stamp_s), message.bytes());
}

Status BagWriter::write_odometry(const std::string& topic, const std::string& frame_id,
                                 const std::string& child_frame_id, double stamp_s, const Pose& T_frame_child) {
  MessageWriter message(file_->serialisation());
  message.header(to_nanoseconds(stamp_s), frame_id);
  message.text(child_frame_id);
  write_vector(message, T_frame_child.translation());
  write_rotation(message, T_frame_child);
  write_zeros(message, 36 + 6 + 36);
  return write(topic, "nav_msgs/Odometry", to_nanoseconds(stamp_s), message.bytes());
}

Status BagWriter::write_static_transform(const std::string& parent, const std::string& child, double stamp_s,
                                         const Pose& T_parent_child) {
  MessageWriter message(file_->serialisation());
  message.number(std::uint32_t{1});
  message.header(to_nanoseconds(stamp_s), parent);
  message.text(child);
  write_vector(message, T_parent_child.translation());
  write_rotation(message, T_parent_child);
  return write("/tf_static", "tf2_msgs/TFMessage", to_nanoseconds(stamp_s), message.bytes());
}

Status BagWriter::finish() { return file_->finish(); }

namespace io_internal {

std::string definition_for_bag(const std::string& type, bool is_ros1) {
  const std::string text =
      known_definition(type, is_ros1) + (is_ros1 ? "" : "MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n");
  std::string result;
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = text.find('\n', begin);
    std::string line = text.substr(begin, end - begin);
    begin = end + 1;
    if (line.starts_with("MSG: ")) result += std::string(80, '=') + "\n";
    if (!is_ros1 && line.starts_with("Header ")) line.insert(0, "std_msgs/");
    if (!is_ros1 && line.starts_with("time ")) line.replace(0, 1, "builtin_interfaces/T");
    result.append(line).append("\n");
  }
  return result;
}

std::string md5_of(const std::string& type) {
  static const std::map<std::string, std::string> kSums = {
      {"sensor_msgs/PointCloud2", "1158d486dd51d683ce2f1be655c3c181"},
      {"sensor_msgs/Imu", "6a62c6daae103f4ff57a132d6f95cec2"},
      {"sensor_msgs/NavSatFix", "2d3a8cd499b9b4a0249fb98fd05cfa48"},
      {"nav_msgs/Odometry", "cd5e73d190d741a2f92e81eda573aca7"},
      {"tf2_msgs/TFMessage", "94810edda583a504dfda3829e70d7eec"}};
  const auto found = kSums.find(type);
  return found == kSums.end() ? "*" : found->second;
}

}  // namespace io_internal
}  // namespace revisit
