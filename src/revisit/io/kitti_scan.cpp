// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <cstdio>
#include <cstring>

#include <revisit/io/internal/bytes.hpp>
#include <revisit/io/internal/kitti_folder.hpp>
#include <revisit/io/internal/scan_formats.hpp>
#include <revisit/io/recording.hpp>
#include <revisit/io/result_files.hpp>

namespace revisit {
namespace {

namespace fs = std::filesystem;
constexpr const char* kTimes = "velodyne_times";
constexpr const char* kRings = "velodyne_rings";

template <typename T>
std::string as_bytes(const std::vector<T>& values) {
  return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)};
}

// Leaves out the values of the file's points that are no returns, which the scan does not hold.
template <typename T>
Status keep_returns(const fs::path& scan_file, const Scan& scan, std::vector<T>& values) {
  const auto bytes = io_internal::read_bytes(scan_file);
  if (!bytes) return bytes.error();
  const std::size_t record_bytes = bytes->size() / values.size();
  if (record_bytes < sizeof(Point) || bytes->size() % values.size() != 0)
    return Error{scan_file.string() + ": " + std::to_string(bytes->size()) + " bytes of points with " +
                 std::to_string(values.size()) + " values; allowed: x y z intensity as float32 for each value"};
  Scan counted;
  std::size_t kept = 0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    Point point;
    std::memcpy(&point, bytes->data() + i * record_bytes, sizeof point);
    if (io_internal::is_return(counted, point)) values[kept++] = values[i];
  }
  if (kept != scan.points.size()) return Error{scan_file.string() + ": changed while it was read; read it again"};
  values.resize(kept);
  return ok();
}

// One value a point of the scan or of its file, or nothing where there is no such file.
template <typename T>
Status read_values(const fs::path& file, const fs::path& scan_file, const Scan& scan, std::vector<T>& values) {
  std::error_code failure;
  if (fs::status(file, failure).type() == fs::file_type::not_found) return ok();
  const auto bytes = io_internal::read_bytes(file);
  if (!bytes) return bytes.error();
  const std::size_t used = scan.points.size(), all = used + scan.dropped_non_finite + scan.dropped_at_origin;
  if (bytes->size() != used * sizeof(T) && bytes->size() != all * sizeof(T))
    return Error{file.string() + ": " + std::to_string(bytes->size()) + " bytes; allowed: " +
                 std::to_string(all * sizeof(T)) + ", for each of the scan's points " + std::to_string(sizeof(T))};
  values.resize(bytes->size() / sizeof(T));
  std::memcpy(values.data(), bytes->data(), bytes->size());
  return values.size() == used ? ok() : keep_returns(scan_file, scan, values);
}

}  // namespace

Status io_internal::read_point_values(const fs::path& folder, const fs::path& scan_file, Scan& scan) {
  const fs::path name = scan_file.filename();
  if (const Status status = read_values(folder / kTimes / name, scan_file, scan, scan.times_s); !status) return status;
  constexpr float kLongestSweep_s = 10.f;
  for (const float time_s : scan.times_s)
    if (!(std::abs(time_s) <= kLongestSweep_s))
      return Error{(folder / kTimes / name).string() + ": a point's time of " + std::to_string(time_s) +
                   " s; allowed: up to 10 s from the scan's"};
  return read_values(folder / kRings / name, scan_file, scan, scan.rings);
}

Status write_kitti_scan(const fs::path& folder, const Scan& scan) {
  require_consistent(scan);
  char name[32];
  std::snprintf(name, sizeof name, "%06lld.bin", static_cast<long long>(scan.frame.value));
  const auto write = [&](const char* kind, const std::string& bytes) -> Status {
    std::error_code failure;
    fs::create_directories(folder / kind, failure);
    if (failure) return Error{(folder / kind).string() + ": cannot be made: " + failure.message()};
    return write_text(folder / kind / name, bytes);
  };
  // The scan itself comes last: where it is, all of it is there.
  if (!scan.times_s.empty())
    if (const Status status = write(kTimes, as_bytes(scan.times_s)); !status) return status;
  if (!scan.rings.empty())
    if (const Status status = write(kRings, as_bytes(scan.rings)); !status) return status;
  return write("velodyne", as_bytes(scan.points));
}

}  // namespace revisit
