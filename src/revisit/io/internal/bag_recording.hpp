// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include <revisit/io/recording.hpp>

namespace revisit::io_internal {

/// The scans of a bag; its odometry and IMU where they are known to belong to them.
Result<std::unique_ptr<Recording>> open_bag_recording(const std::filesystem::path& path,
                                                      const RecordingOptions& options, const LogSink& log);
/// The scans in the packets of a capture.
Result<std::unique_ptr<Recording>> open_capture_recording(const std::filesystem::path& file,
                                                          const RecordingOptions& options, const LogSink& log);
bool is_capture(const std::filesystem::path& path);

/// Poses of a file for the scans of a recording that is open.
Result<Trajectory> read_trajectory(const std::filesystem::path& poses_file, const Recording& recording);

/// The recording with the poses of that file, if one is named.
template <typename Kind>
Result<std::unique_ptr<Recording>> with_poses(std::unique_ptr<Kind> recording,
                                              const std::filesystem::path& poses_file) {
  if (!poses_file.empty()) {
    auto trajectory = read_trajectory(poses_file, *recording);
    if (!trajectory) return trajectory.error();
    recording->set_trajectory(*std::move(trajectory));
  }
  return std::unique_ptr<Recording>(std::move(recording));
}

}  // namespace revisit::io_internal
