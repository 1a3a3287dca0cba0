// SPDX-License-Identifier: Apache-2.0
#include <revisit/io/point_cloud.hpp>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>

#include <revisit/io/internal/byte_cursor.hpp>
#include <revisit/io/internal/scan_formats.hpp>
#include <revisit/io/internal/sweep_times.hpp>

namespace revisit {
namespace {

using Field = PointCloudView::Field;

const Field* find_field(const PointCloudView& cloud, std::initializer_list<std::string_view> names) {
  for (const std::string_view name : names)
    for (const Field& field : cloud.fields) {
      std::string lower = field.name;
      std::transform(lower.begin(), lower.end(), lower.begin(),
                     [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
      if (lower == name) return &field;
    }
  return nullptr;
}

// Reads one field of a record, chosen once for all records.
class FieldReader {
 public:
  FieldReader(const Field* field, bool is_big_endian) {
    if (field == nullptr) return;
    offset_ = field->offset;
    using Load = double (*)(const std::uint8_t*, bool);
    static constexpr std::array<Load, 8> kLoads{&load<std::int8_t>,   &load<std::uint8_t>, &load<std::int16_t>,
                                                &load<std::uint16_t>, &load<std::int32_t>, &load<std::uint32_t>,
                                                &load<float>,         &load<double>};
    load_ = kLoads.at(field->type - 1u);
    is_big_endian_ = is_big_endian;
  }
  explicit operator bool() const { return load_ != nullptr; }
  double operator()(const std::uint8_t* record) const { return load_(record + offset_, is_big_endian_); }

 private:
  template <typename T>
  static double load(const std::uint8_t* at, bool is_big_endian) {
    return static_cast<double>(io_internal::load_number<T>(at, is_big_endian));
  }
  double (*load_)(const std::uint8_t*, bool) = nullptr;
  std::size_t offset_ = 0;
  bool is_big_endian_ = false;
};

constexpr std::array<std::size_t, 8> kFieldBytes{1, 1, 2, 2, 4, 4, 4, 8};

Status check(const PointCloudView& cloud, const std::string& what) {
  const auto wrong = [&](const std::string& reason) { return Error{what + ": " + reason}; };
  constexpr std::size_t kMost = std::size_t{1} << 31;
  if (cloud.width > kMost || cloud.height > kMost || cloud.point_step > kMost || cloud.row_step > kMost)
    return wrong("a cloud of " + std::to_string(cloud.width) + " x " + std::to_string(cloud.height) + " points");
  std::size_t record = 0;  // bytes of it that are used: the last one may lack its padding
  for (const Field& field : cloud.fields) {
    if (field.type < 1 || field.type > kFieldBytes.size())
      return wrong("field '" + field.name + "' has type " + std::to_string(field.type) + "; allowed: 1 to 8");
    if (field.offset + kFieldBytes[field.type - 1u] > cloud.point_step)
      return wrong("field '" + field.name + "' at byte " + std::to_string(field.offset) + " of a point of " +
                   std::to_string(cloud.point_step) + " bytes");
    record = std::max(record, field.offset + kFieldBytes[field.type - 1u]);
  }
  const std::size_t row = cloud.row_step != 0 ? cloud.row_step : cloud.width * cloud.point_step;
  const std::size_t used = cloud.width * cloud.point_step;
  if (used > row)
    return wrong("rows of " + std::to_string(row) + " bytes hold no " + std::to_string(cloud.width) + " points of " +
                 std::to_string(cloud.point_step));
  const std::size_t last_row = used - std::min(used, cloud.point_step) + record;
  if (cloud.width != 0 && cloud.height != 0 &&
      (last_row > cloud.data.size() ||
       cloud.height - 1 > (cloud.data.size() - last_row) / std::max<std::size_t>(row, 1)))
    return wrong(std::to_string(cloud.width) + " x " + std::to_string(cloud.height) + " points declared, " +
                 std::to_string(cloud.data.size()) + " bytes there");
  return ok();
}

struct Readers {
  FieldReader x, y, z, intensity, ring, time, time_ns;
};

void read_points(const PointCloudView& cloud, const Readers& read, Scan& scan, std::vector<double>& raw_times,
                 bool& rings_are_whole) {
  const std::size_t points = cloud.width * cloud.height;
  scan.points.reserve(points);
  if (read.ring) scan.rings.reserve(points);
  if (read.time) raw_times.reserve(points);
  const std::size_t row = cloud.row_step != 0 ? cloud.row_step : cloud.width * cloud.point_step;
  for (std::size_t i = 0; i < cloud.height; ++i) {
    const std::uint8_t* record = cloud.data.data() + i * row;
    for (std::size_t j = 0; j < cloud.width; ++j, record += cloud.point_step) {
      const Point point{static_cast<float>(read.x(record)), static_cast<float>(read.y(record)),
                        static_cast<float>(read.z(record)),
                        read.intensity ? static_cast<float>(read.intensity(record)) : 0.f};
      if (!io_internal::append_point(scan, point)) continue;
      if (read.ring) {
        constexpr double kMostRings = 1024;
        const double value = read.ring(record);
        rings_are_whole &= value >= 0 && value < kMostRings && value == std::floor(value);
        scan.rings.push_back(rings_are_whole ? static_cast<std::uint16_t>(value) : std::uint16_t{0});
      }
      if (read.time) raw_times.push_back(read.time(record) + (read.time_ns ? 1e-9 * read.time_ns(record) : 0.0));
    }
  }
}

}  // namespace

Result<Scan> to_scan(const PointCloudView& cloud, const std::optional<double>& stamp_s, const std::string& what,
                     const LogSink& log, PointTimes* times) {
  PointTimes unused;
  PointTimes& found = times != nullptr ? *times : unused;
  found = {};
  if (const Status status = check(cloud, what); !status) return status.error();
  const Field* position[3] = {find_field(cloud, {"x"}), find_field(cloud, {"y"}), find_field(cloud, {"z"})};
  for (std::size_t i = 0; i < 3; ++i)
    if (position[i] == nullptr) return Error{what + ": no field '" + std::string(1, "xyz"[i]) + "'"};
  const Field* intensity = find_field(
      cloud, {"intensity", "scalar_intensity", "reflectivity", "reflectance", "remission", "intensities", "i"});
  const Field* ring = find_field(cloud, {"ring", "laser", "line", "channel", "laser_id", "scalar_ring"});
  const Field* time = find_field(cloud, {"t", "time", "timestamp", "time_offset", "offset_time", "scalar_time"});
  const Field* time_ns = nullptr;
  if (time == nullptr) {  // seconds and nanoseconds apart
    time = find_field(cloud, {"time_sec", "timestamp_sec", "stamp_sec", "t_sec"});
    time_ns = find_field(cloud, {"time_nsec", "timestamp_nsec", "stamp_nsec", "t_nsec"});
    if (time_ns == nullptr) time = nullptr;
  }
  if (intensity == nullptr) log_to(log, LogLevel::kWarning, what + ": no intensity field; 0 is used");

  const bool reversed = cloud.is_big_endian;
  const Readers read{{position[0], reversed}, {position[1], reversed}, {position[2], reversed}, {intensity, reversed},
                     {ring, reversed},        {time, reversed},        {time_ns, reversed}};
  Scan scan;
  if (stamp_s) scan.stamp_s = *stamp_s;
  std::vector<double> raw_times;
  bool rings_are_whole = true;
  read_points(cloud, read, scan, raw_times, rings_are_whole);
  if (!rings_are_whole) {
    scan.rings.clear();
    log_to(log, LogLevel::kWarning, what + ": field '" + ring->name + "' holds no ring numbers; not used");
  }
  if (time == nullptr) return scan;
  found.field = time->name + (time_ns != nullptr ? "+" + time_ns->name : "");
  const bool has_points = !raw_times.empty();
  scan.times_s = io_internal::to_sweep_times(std::move(raw_times), stamp_s, found);
  if (has_points && scan.times_s.empty())
    log_to(log, LogLevel::kWarning, what + ": field '" + found.field + "' holds no times of a sweep; not used");
  return scan;
}

}  // namespace revisit
