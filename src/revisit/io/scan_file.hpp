// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include <revisit/core/log.hpp>
#include <revisit/core/result.hpp>
#include <revisit/core/scan.hpp>

namespace revisit {

/// Reads one scan from a .bin (KITTI, nuScenes, NCLT: recognised by content), .pcd, .ply or .las file.
/// Points that are not finite or exactly (0,0,0) are dropped and counted in the scan. Frame and stamp stay 0.
/// An error names the file and the reason; a file without a single usable point is an error.
/// Remarks about odd but readable files go to `log`. Safe to call from several threads.
Result<Scan> read_scan(const std::filesystem::path& file, const LogSink& log = {});

/// Whether the name ends like a scan file that read_scan may read (.bin, .pcd, .ply, .las).
bool has_scan_extension(const std::filesystem::path& file);

}  // namespace revisit
