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

const PointCloudView::Field* find_field(const PointCloudView& cloud, std::initializer_list<std::string_view> names) {
  for (const std::string_view name : names)
    for (const PointCloudView::Field& field : cloud.fields) {
      std::string lower = field.name;
      std::transform(lower.begin(), lower.end(), lower.begin(),
                     [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
      if (lower == name) return &field;
    }
  return nullptr;
}

// Copies one field of all records, as T, to every `stride`th place of `target`: the type is chosen once a cloud, and
// the loop over points is as tight as it gets.
template <typename T>
class Column {
 public:
  Column(const PointCloudView::Field* field, bool is_big_endian) : field_(field), is_big_endian_(is_big_endian) {}
  explicit operator bool() const { return field_ != nullptr; }

  void copy(const std::uint8_t* records, std::size_t step, std::size_t count, T* target, std::size_t stride) const {
    using Copy = void (*)(const std::uint8_t*, std::size_t, std::size_t, T*, std::size_t);
    static constexpr std::array<Copy, 8> kCopies{
        &copy_as<std::int8_t>,  &copy_as<std::uint8_t>,  &copy_as<std::int16_t>, &copy_as<std::uint16_t>,
        &copy_as<std::int32_t>, &copy_as<std::uint32_t>, &copy_as<float>,        &copy_as<double>};
    static constexpr std::array<Copy, 8> kReversed{&copy_reversed<std::int8_t>,  &copy_reversed<std::uint8_t>,
                                                   &copy_reversed<std::int16_t>, &copy_reversed<std::uint16_t>,
                                                   &copy_reversed<std::int32_t>, &copy_reversed<std::uint32_t>,
                                                   &copy_reversed<float>,        &copy_reversed<double>};
    (is_big_endian_ ? kReversed : kCopies).at(field_->type - 1u)(records + field_->offset, step, count, target, stride);
  }

 private:
  template <typename Stored>
  static void copy_as(const std::uint8_t* at, std::size_t step, std::size_t count, T* target, std::size_t stride) {
    for (std::size_t i = 0; i < count; ++i, at += step, target += stride)
      *target = static_cast<T>(io_internal::load_number<Stored>(at));
  }
  template <typename Stored>
  static void copy_reversed(const std::uint8_t* at, std::size_t step, std::size_t count, T* target,
                            std::size_t stride) {
    for (std::size_t i = 0; i < count; ++i, at += step, target += stride)
      *target = static_cast<T>(io_internal::load_number<Stored>(at, true));
  }

  const PointCloudView::Field* field_;
  bool is_big_endian_;
};

constexpr std::array<std::size_t, 8> kFieldBytes{1, 1, 2, 2, 4, 4, 4, 8};

Status check(const PointCloudView& cloud, const std::string& what) {
  const auto wrong = [&](const std::string& reason) { return Error{what + ": " + reason}; };
  constexpr std::size_t kMost = std::size_t{1} << 31;
  if (cloud.width > kMost || cloud.height > kMost || cloud.point_step > kMost || cloud.row_step > kMost)
    return wrong("a cloud of " + std::to_string(cloud.width) + " x " + std::to_string(cloud.height) + " points");
  std::size_t record = 0;  // bytes of it that are used: the last one may lack its padding
  for (const PointCloudView::Field& field : cloud.fields) {
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

struct Columns {
  Column<float> x, y, z, intensity;
  Column<double> ring, time, time_ns;
};

// A row of the cloud; `values` keeps rings and times of its points, with or without return.
struct CloudRow {
  std::vector<double> rings, times, times_ns;
};

void read_row(const std::uint8_t* records, std::size_t step, std::size_t count, const Columns& columns, Point* points,
              CloudRow& row) {
  constexpr std::size_t kStride = sizeof(Point) / sizeof(float);
  columns.x.copy(records, step, count, &points->x, kStride);
  columns.y.copy(records, step, count, &points->y, kStride);
  columns.z.copy(records, step, count, &points->z, kStride);
  if (columns.intensity) columns.intensity.copy(records, step, count, &points->intensity, kStride);
  if (columns.ring) columns.ring.copy(records, step, count, row.rings.data(), 1);
  if (columns.time) columns.time.copy(records, step, count, row.times.data(), 1);
  if (!columns.time_ns) return;
  columns.time_ns.copy(records, step, count, row.times_ns.data(), 1);
  for (std::size_t i = 0; i < count; ++i) row.times[i] += 1e-9 * row.times_ns[i];
}

void read_points(const PointCloudView& cloud, const Columns& columns, Scan& scan, std::vector<double>& raw_times,
                 bool& rings_are_whole) {
  if (cloud.width == 0) return;
  const std::size_t points = cloud.width * cloud.height;
  const std::size_t row_bytes = cloud.row_step != 0 ? cloud.row_step : cloud.width * cloud.point_step;
  scan.points.resize(points);
  if (columns.ring) scan.rings.resize(points);
  if (columns.time) raw_times.resize(points);
  CloudRow row{std::vector<double>(columns.ring ? cloud.width : 0), std::vector<double>(columns.time ? cloud.width : 0),
               std::vector<double>(columns.time_ns ? cloud.width : 0)};
  std::size_t kept = 0;
  for (std::size_t i = 0; i < cloud.height; ++i) {
    // Where the row goes at first: what is kept of it moves up within itself.
    Point* const here = scan.points.data() + kept;
    read_row(cloud.data.data() + i * row_bytes, cloud.point_step, cloud.width, columns, here, row);
    for (std::size_t j = 0; j < cloud.width; ++j) {
      const Point point = here[j];
      if (!io_internal::is_return(scan, point)) continue;
      scan.points[kept] = point;
      if (!std::isfinite(point.intensity)) scan.points[kept].intensity = 0.f;
      if (columns.ring) {
        constexpr double kMostRings = 1024;
        const double value = row.rings[j];
        rings_are_whole &= value >= 0 && value < kMostRings && value == std::floor(value);
        scan.rings[kept] = rings_are_whole ? static_cast<std::uint16_t>(value) : std::uint16_t{0};
      }
      if (columns.time) raw_times[kept] = row.times[j];
      ++kept;
    }
  }
  scan.points.resize(kept);
  if (columns.ring) scan.rings.resize(kept);
  if (columns.time) raw_times.resize(kept);
}

}  // namespace

Result<Scan> to_scan(const PointCloudView& cloud, const std::optional<double>& stamp_s, const std::string& what,
                     const LogSink& log, PointTimes* times) {
  PointTimes unused;
  PointTimes& found = times != nullptr ? *times : unused;
  found = {};
  if (const Status status = check(cloud, what); !status) return status.error();
  const PointCloudView::Field* position[3] = {find_field(cloud, {"x"}), find_field(cloud, {"y"}),
                                              find_field(cloud, {"z"})};
  for (std::size_t i = 0; i < 3; ++i)
    if (position[i] == nullptr) return Error{what + ": no field '" + std::string(1, "xyz"[i]) + "'"};
  const PointCloudView::Field* intensity = find_field(
      cloud, {"intensity", "scalar_intensity", "reflectivity", "reflectance", "remission", "intensities", "i"});
  const PointCloudView::Field* ring =
      find_field(cloud, {"ring", "laser", "line", "channel", "laser_id", "scalar_ring"});
  const PointCloudView::Field* time =
      find_field(cloud, {"t", "time", "timestamp", "time_offset", "offset_time", "scalar_time"});
  const PointCloudView::Field* time_ns = nullptr;
  if (time == nullptr) {  // seconds and nanoseconds apart
    time = find_field(cloud, {"time_sec", "timestamp_sec", "stamp_sec", "t_sec"});
    time_ns = find_field(cloud, {"time_nsec", "timestamp_nsec", "stamp_nsec", "t_nsec"});
    if (time == nullptr || time_ns == nullptr) time = time_ns = nullptr;
  }
  if (intensity == nullptr) log_to(log, LogLevel::kWarning, what + ": no intensity field; 0 is used");

  const bool reversed = cloud.is_big_endian;
  const Columns columns{{position[0], reversed}, {position[1], reversed}, {position[2], reversed},
                        {intensity, reversed},   {ring, reversed},        {time, reversed},
                        {time_ns, reversed}};
  Scan scan;
  if (stamp_s) scan.stamp_s = *stamp_s;
  std::vector<double> raw_times;
  bool rings_are_whole = true;
  read_points(cloud, columns, scan, raw_times, rings_are_whole);
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
