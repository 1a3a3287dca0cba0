// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>

#include <revisit/core/log.hpp>
#include <revisit/io/recording.hpp>

namespace revisit {

/// How many scans were written, and how many could not be read (their errors are logged).
struct Converted {
  std::size_t scans = 0, skipped = 0;
};

/// Writes a recording in another form: a bag, where `out` ends in .bag, .mcap or .db3 (topics /points, /imu, /odom,
/// /tf_static; exact poses as OUT.poses.tum beside it), else a KITTI odometry folder with point times and rings. `out`
/// must not exist, or be an empty folder. Memory holds one scan. `on_scan(done)` ends the work by returning false.
Result<Converted> convert_recording(const Recording& recording, const std::filesystem::path& out,
                                    const LogSink& log = {}, const std::function<bool(std::size_t)>& on_scan = {});

/// Whether the name is that of a bag that BagWriter writes.
bool is_bag_name(const std::filesystem::path& file);

}  // namespace revisit
