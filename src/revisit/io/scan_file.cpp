// SPDX-License-Identifier: Apache-2.0
#include <revisit/io/scan_file.hpp>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <exception>

#include <revisit/io/internal/scan_formats.hpp>

namespace revisit {
namespace {

std::string lower_extension(const std::filesystem::path& file) {
  std::string extension = file.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return extension;
}

Result<Scan> read_any(const std::filesystem::path& file, const LogSink& log) {
  std::error_code failure;
  if (!std::filesystem::exists(file, failure))
    return Error{file.string() + ": no such file or folder" + (failure ? " (" + failure.message() + ")" : "")};
  const std::string extension = lower_extension(file);
  if (extension == ".bin") return io_internal::read_bin(file);
  if (extension == ".pcd") return io_internal::read_pcd(file, log);
  if (extension == ".ply") return io_internal::read_ply(file, log);
  if (extension == ".las") return io_internal::read_las(file, log);
  if (extension == ".laz")
    return Error{file.string() +
                 ": compressed LAS is not read; `laszip -i FILE -o FILE.las` or `pdal translate` unpacks it"};
  if (extension == ".e57")
    return Error{file.string() + ": E57 is not read; `pdal translate FILE.e57 FILE.las` or CloudCompare converts it"};
  return Error{file.string() + ": unknown kind of scan '" + extension + "'; allowed: .bin, .pcd, .ply, .las"};
}

}  // namespace

namespace io_internal {

bool append_point(Scan& scan, const Point& point) {
  if (!is_return(scan, point)) return false;
  scan.points.push_back(point);
  if (!std::isfinite(point.intensity)) scan.points.back().intensity = 0.f;
  return true;
}

}  // namespace io_internal

bool has_scan_extension(const std::filesystem::path& file) {
  const std::string extension = lower_extension(file);
  return extension == ".bin" || extension == ".pcd" || extension == ".ply" || extension == ".las";
}

Result<Scan> read_scan(const std::filesystem::path& file, const LogSink& log) {
  try {
    Result<Scan> scan = read_any(file, log);
    if (scan && scan->points.empty())
      return Error{file.string() + ": no usable point: " + std::to_string(scan->dropped_non_finite) + " not finite, " +
                   std::to_string(scan->dropped_at_origin) + " at (0,0,0)"};
    return scan;
  } catch (const std::exception& problem) {  // what the readers underneath throw on broken files
    return Error{file.string() + ": cannot be read: " + problem.what()};
  }
}

}  // namespace revisit
