// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <cstdio>
#include <cstring>

#include <revisit/io/internal/bytes.hpp>
#include <revisit/io/internal/kitti_folder.hpp>
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

// One value a point, or nothing where there is no such file.
template <typename T>
Status read_values(const fs::path& file, const Scan& scan, std::vector<T>& values) {
  std::error_code failure;
  if (fs::status(file, failure).type() == fs::file_type::not_found) return ok();
  const auto bytes = io_internal::read_bytes(file);
  if (!bytes) return bytes.error();
  if (bytes->size() != scan.points.size() * sizeof(T))
    return Error{file.string() + ": " + std::to_string(bytes->size()) +
                 " bytes; allowed: " + std::to_string(scan.points.size() * sizeof(T)) +
                 ", for each of the scan's points " + std::to_string(sizeof(T))};
  values.resize(scan.points.size());
  std::memcpy(values.data(), bytes->data(), bytes->size());
  return ok();
}

}  // namespace

Status io_internal::read_point_values(const fs::path& folder, const fs::path& name, Scan& scan) {
  if (const Status status = read_values(folder / kTimes / name, scan, scan.times_s); !status) return status;
  constexpr float kLongestSweep_s = 10.f;
  for (const float time_s : scan.times_s)
    if (!(std::abs(time_s) <= kLongestSweep_s))
      return Error{(folder / kTimes / name).string() + ": a point's time of " + std::to_string(time_s) +
                   " s; allowed: up to 10 s from the scan's"};
  return read_values(folder / kRings / name, scan, scan.rings);
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
