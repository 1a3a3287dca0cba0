// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <filesystem>
#include <string_view>

#include <revisit/core/log.hpp>
#include <revisit/core/result.hpp>
#include <revisit/core/scan.hpp>

namespace pcl {
struct PCLPointCloud2;
}

namespace revisit::io_internal {

/// KITTI (x y z intensity float32), nuScenes (and ring), NCLT (uint16 x y z, uint8 intensity, uint8 laser):
/// told apart by size and content, since all end in .bin.
Result<Scan> read_bin(const std::filesystem::path& file);
Result<Scan> read_pcd(const std::filesystem::path& file, const LogSink& log);
Result<Scan> read_ply(const std::filesystem::path& file, const LogSink& log);
Result<Scan> read_las(const std::filesystem::path& file, const LogSink& log);

/// The scan in a PCL cloud of any field layout; fields are found by the names that drivers use.
Result<Scan> to_scan(const std::filesystem::path& file, const pcl::PCLPointCloud2& cloud, const LogSink& log);

/// Whether the point is finite and not at (0,0,0); counts it in the scan where it is not.
inline bool is_return(Scan& scan, const Point& point) {
  if (!(std::isfinite(point.x) && std::isfinite(point.y) && std::isfinite(point.z))) {
    ++scan.dropped_non_finite;
    return false;
  }
  if (point.x == 0.f && point.y == 0.f && point.z == 0.f) {
    ++scan.dropped_at_origin;
    return false;
  }
  return true;
}
/// Appends the point unless it is not finite or at (0,0,0), which are counted; says whether it did.
bool append_point(Scan& scan, const Point& point);

/// PCL prints on its own; this switches that off for the process.
void silence_pcl();

}  // namespace revisit::io_internal
