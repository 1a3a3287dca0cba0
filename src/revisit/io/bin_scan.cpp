// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

#include <revisit/io/internal/bytes.hpp>
#include <revisit/io/internal/scan_formats.hpp>

namespace revisit::io_internal {
namespace {

constexpr std::size_t kKittiBytes = 4 * sizeof(float);     // x y z intensity
constexpr std::size_t kNuscenesBytes = 5 * sizeof(float);  // and ring
constexpr std::size_t kNcltBytes = 8;                      // uint16 x y z, uint8 intensity, uint8 laser
constexpr float kLargestCoordinate = 5000.f;               // metres; beyond any LiDAR
constexpr float kLargestRing = 255.f;

template <typename T>
T load(const char* bytes) {
  T value;
  std::memcpy(&value, bytes, sizeof value);
  return value;
}

// A number that a sensor could have written: no value, zero, rounding noise, or of a size that metres and intensities
// have. Floats made from other data mostly have wild exponents.
bool is_plausible(float value) {
  const float size = std::abs(value);
  return !std::isfinite(value) || size == 0.f || (size > 1e-25f && size < 1e6f);
}

// The share of the records that pass `test`; every n-th one is looked at, some 4,000 in all.
template <typename Test>
double share_of_records(const std::string& bytes, std::size_t record_bytes, Test test) {
  const std::size_t records = bytes.size() / record_bytes;
  const std::size_t step = std::max<std::size_t>(1, records / 4000);
  std::size_t tested = 0, passed = 0;
  for (std::size_t i = 0; i < records; i += step, ++tested) passed += test(bytes.data() + i * record_bytes);
  return tested == 0 ? 0.0 : static_cast<double>(passed) / static_cast<double>(tested);
}

bool is_plausible_point(const char* record) {
  for (std::size_t i = 0; i < 3; ++i) {
    const float value = load<float>(record + i * sizeof(float));
    if (!is_plausible(value) || (std::isfinite(value) && std::abs(value) > kLargestCoordinate)) return false;
  }
  return is_plausible(load<float>(record + 3 * sizeof(float)));
}

// How far neighbouring records of `floats` values lie apart in x, y and z, as a share of the whole spread: small where
// the records are cut right, large where values of different meaning share a column.
double roughness(const std::string& bytes, std::size_t floats) {
  const std::size_t records = std::min<std::size_t>(bytes.size() / (floats * sizeof(float)), 20000);
  if (records < 2) return 0.0;
  double sum = 0.0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    double steps = 0.0, mean = 0.0, spread = 0.0;
    std::vector<double> column;
    for (std::size_t i = 0; i < records; ++i) {
      const float value = load<float>(bytes.data() + (i * floats + axis) * sizeof(float));
      if (std::isfinite(value)) column.push_back(std::clamp(static_cast<double>(value), -1e3, 1e3));
    }
    if (column.size() < 2) continue;
    for (const double value : column) mean += value / static_cast<double>(column.size());
    for (std::size_t i = 1; i < column.size(); ++i) steps += std::abs(column[i] - column[i - 1]);
    for (const double value : column) spread += std::abs(value - mean);
    sum += spread > 0.0 ? steps / spread : 0.0;
  }
  return sum;
}

// Whether records of 8 floats are two points each: of two beams that a sensor fires one after the other, which may
// point far up and down, but much the same way. Anything else (a normal, a time) is of another size or points
// elsewhere.
bool are_two_points(const std::string& bytes) {
  constexpr float kMostTimesAsFar = 10.f, kLeastCosine = 0.85f;  // 30 degrees, seen from above
  return share_of_records(bytes, 2 * kKittiBytes, [](const char* record) {
           const auto first = load<Point>(record), second = load<Point>(record + kKittiBytes);
           const float first_m = std::hypot(first.x, first.y), second_m = std::hypot(second.x, second.y);
           return first_m <= kMostTimesAsFar * second_m && second_m <= kMostTimesAsFar * first_m &&
                  first.x * second.x + first.y * second.y >= kLeastCosine * first_m * second_m;
         }) > 0.8;
}

// The number of floats a record, of those that divide the file, whose columns are smoothest; 4 unless another is
// clearly smoother (points in random order are rough in any width).
std::size_t likely_floats_per_record(const std::string& bytes) {
  constexpr double kRandomOrder = 4.0;  // of three columns, 4/3 each
  std::size_t best = 4;
  double least = bytes.size() % kKittiBytes == 0 ? 0.7 * std::min(kRandomOrder, roughness(bytes, 4))
                                                 : std::numeric_limits<double>::infinity();
  for (const std::size_t floats : {3u, 5u, 6u, 7u, 8u}) {
    if (bytes.size() % (floats * sizeof(float)) != 0) continue;
    const double here = roughness(bytes, floats);
    if (here >= least || (floats == 8 && are_two_points(bytes))) continue;
    least = here;
    best = floats;
  }
  return best;
}

bool is_nuscenes(const std::string& bytes) {
  if (bytes.size() % kNuscenesBytes != 0) return false;
  bool any_ring = false;
  const double share = share_of_records(bytes, kNuscenesBytes, [&](const char* record) {
    const float ring = load<float>(record + kKittiBytes);
    any_ring |= ring > 0.f;
    return ring >= 0.f && ring <= kLargestRing && ring == std::floor(ring) && is_plausible_point(record);
  });
  return share == 1.0 && any_ring;
}

bool is_kitti(const std::string& bytes) {
  return bytes.size() % kKittiBytes == 0 && share_of_records(bytes, kKittiBytes, is_plausible_point) > 0.99;
}

bool is_nclt(const std::string& bytes) {
  return bytes.size() % kNcltBytes == 0 && share_of_records(bytes, kNcltBytes, [](const char* record) {
                                             return load<std::uint8_t>(record + 7) < 32;
                                           }) == 1.0;
}

Scan read_floats(const std::string& bytes, std::size_t record_bytes) {
  Scan scan;
  const std::size_t records = bytes.size() / record_bytes;
  const bool has_rings = record_bytes == kNuscenesBytes;
  scan.points.reserve(records);
  if (has_rings) scan.rings.reserve(records);
  for (std::size_t i = 0; i < records; ++i) {
    const char* record = bytes.data() + i * record_bytes;
    if (append_point(scan, load<Point>(record)) && has_rings)
      scan.rings.push_back(static_cast<std::uint16_t>(load<float>(record + kKittiBytes)));
  }
  return scan;
}

Scan read_nclt(const std::string& bytes) {
  Scan scan;
  const auto metres = [](const char* at) { return static_cast<float>(load<std::uint16_t>(at) * 0.005 - 100.0); };
  for (std::size_t i = 0; i + kNcltBytes <= bytes.size(); i += kNcltBytes) {
    const char* record = bytes.data() + i;
    // NCLT's frame has x forward, y right, z down; ours has y left, z up.
    const Point point{metres(record), -metres(record + 2), -metres(record + 4),
                      static_cast<float>(load<std::uint8_t>(record + 6))};
    if (append_point(scan, point)) scan.rings.push_back(load<std::uint8_t>(record + 7));
  }
  return scan;
}

}  // namespace

Result<Scan> read_bin(const std::filesystem::path& file) {
  const auto bytes = read_bytes(file);
  if (!bytes) return bytes.error();
  if (bytes->empty()) return Error{file.string() + ": empty file"};
  const std::size_t floats = likely_floats_per_record(*bytes);
  if (floats == 5 && is_nuscenes(*bytes)) return read_floats(*bytes, kNuscenesBytes);
  if (is_kitti(*bytes)) {
    if (floats == 4) return read_floats(*bytes, kKittiBytes);
    return Error{file.string() + ": looks like records of " + std::to_string(floats) +
                 " floats; allowed: 4 (x y z intensity) or 5 with a ring number"};
  }
  if (is_nclt(*bytes)) return read_nclt(*bytes);
  const std::string size = std::to_string(bytes->size()) + " bytes";
  if (bytes->size() % kKittiBytes != 0)
    return Error{file.string() + ": " + size + " is no multiple of 16 (x y z intensity, float32): truncated?"};
  return Error{file.string() + ": " + size + " hold neither float32 x y z intensity [ring] in metres nor NCLT points"};
}

}  // namespace revisit::io_internal
