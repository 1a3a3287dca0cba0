// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <cstring>
#include <limits>

#include <pcl/PCLPointCloud2.h>

#include <revisit/io/internal/scan_formats.hpp>

namespace revisit::io_internal {
namespace {

using pcl::PCLPointField;

const PCLPointField* find_field(const pcl::PCLPointCloud2& cloud, std::initializer_list<std::string_view> names) {
  for (std::string_view name : names)
    for (const PCLPointField& field : cloud.fields) {
      std::string lower = field.name;
      std::transform(lower.begin(), lower.end(), lower.begin(),
                     [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
      if (lower == name) return &field;
    }
  return nullptr;
}

template <typename T>
double load(const std::uint8_t* at) {
  T value;
  std::memcpy(&value, at, sizeof value);
  return static_cast<double>(value);
}

double value_of(const PCLPointField& field, const std::uint8_t* record) {
  const std::uint8_t* at = record + field.offset;
  switch (field.datatype) {
    case PCLPointField::INT8:
      return load<std::int8_t>(at);
    case PCLPointField::UINT8:
      return load<std::uint8_t>(at);
    case PCLPointField::INT16:
      return load<std::int16_t>(at);
    case PCLPointField::UINT16:
      return load<std::uint16_t>(at);
    case PCLPointField::INT32:
      return load<std::int32_t>(at);
    case PCLPointField::UINT32:
      return load<std::uint32_t>(at);
    case PCLPointField::FLOAT32:
      return load<float>(at);
    case PCLPointField::FLOAT64:
      return load<double>(at);
    default:
      return std::numeric_limits<double>::quiet_NaN();
  }
}

// Drivers write the time of a point in seconds, micro- or nanoseconds, from the sweep's start or from an epoch. A sweep
// lasts between a millisecond and two seconds, which gives the unit; anything else is no time.
std::vector<float> to_sweep_times(const std::vector<double>& raw) {
  if (raw.empty() || !std::all_of(raw.begin(), raw.end(), [](double value) { return std::isfinite(value); })) return {};
  const auto [first, last] = std::minmax_element(raw.begin(), raw.end());
  for (const double unit_s : {1.0, 1e-3, 1e-6, 1e-9}) {
    const double sweep_s = (*last - *first) * unit_s;
    if (sweep_s < 1e-3 || sweep_s > 2.0) continue;
    std::vector<float> times;
    times.reserve(raw.size());
    for (const double value : raw) times.push_back(static_cast<float>((value - *first) * unit_s));
    return times;
  }
  return {};
}

}  // namespace

Result<Scan> to_scan(const std::filesystem::path& file, const pcl::PCLPointCloud2& cloud, const LogSink& log) {
  const PCLPointField* position[3] = {find_field(cloud, {"x"}), find_field(cloud, {"y"}), find_field(cloud, {"z"})};
  for (std::size_t i = 0; i < 3; ++i)
    if (position[i] == nullptr) return Error{file.string() + ": no field '" + std::string(1, "xyz"[i]) + "'"};
  const PCLPointField* intensity = find_field(
      cloud, {"intensity", "scalar_intensity", "reflectivity", "reflectance", "remission", "intensities", "i"});
  const PCLPointField* ring = find_field(cloud, {"ring", "laser", "line", "channel", "laser_id", "scalar_ring"});
  const PCLPointField* time =
      find_field(cloud, {"t", "time", "timestamp", "time_offset", "offset_time", "scalar_time"});
  if (intensity == nullptr) log_to(log, LogLevel::kWarning, file.string() + ": no intensity field; 0 is used");

  const std::size_t points = std::size_t{cloud.width} * cloud.height;
  if (cloud.point_step == 0 || cloud.data.size() / cloud.point_step < points)
    return Error{file.string() + ": " + std::to_string(points) + " points declared, " +
                 std::to_string(cloud.data.size()) + " bytes read"};
  Scan scan;
  scan.points.reserve(points);
  std::vector<double> raw_times;
  bool rings_are_whole = true;
  for (std::size_t i = 0; i < points; ++i) {
    const std::uint8_t* record = cloud.data.data() + i * cloud.point_step;
    const auto coordinate = [&](std::size_t axis) { return static_cast<float>(value_of(*position[axis], record)); };
    const Point point{coordinate(0), coordinate(1), coordinate(2),
                      intensity != nullptr ? static_cast<float>(value_of(*intensity, record)) : 0.f};
    if (!append_point(scan, point)) continue;
    if (ring != nullptr) {
      constexpr double kMostRings = 1024;
      const double value = value_of(*ring, record);
      rings_are_whole &= value >= 0 && value < kMostRings && value == std::floor(value);
      scan.rings.push_back(rings_are_whole ? static_cast<std::uint16_t>(value) : std::uint16_t{0});
    }
    if (time != nullptr) raw_times.push_back(value_of(*time, record));
  }
  if (!rings_are_whole) {
    scan.rings.clear();
    log_to(log, LogLevel::kWarning, file.string() + ": field '" + ring->name + "' holds no ring numbers; not used");
  }
  scan.times_s = to_sweep_times(raw_times);
  if (!raw_times.empty() && scan.times_s.empty())
    log_to(log, LogLevel::kWarning, file.string() + ": field '" + time->name + "' holds no times of a sweep; not used");
  return scan;
}

}  // namespace revisit::io_internal
