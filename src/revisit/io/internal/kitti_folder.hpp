// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include <revisit/core/pose.hpp>
#include <revisit/core/result.hpp>
#include <revisit/core/scan.hpp>

namespace revisit::io_internal {

/// Row `key` of a KITTI calib.txt, 3 x 4, e.g. "Tr" (LiDAR to camera 0).
Result<Pose> read_kitti_calibration(const std::filesystem::path& file, const std::string& key);

/// The rows R: and T: of KITTI raw's calib_imu_to_velo.txt.
Result<Pose> read_kitti_raw_calibration(const std::filesystem::path& file);

/// times.txt (one number a row) or KITTI raw timestamps.txt (date and time a row), seconds; row i belongs to frame i.
Result<std::vector<double>> read_times(const std::filesystem::path& file);
Result<std::vector<double>> read_timestamps(const std::filesystem::path& file);

/// The IMU poses of a KITTI raw `oxts` folder, by the number in the file's name, in a local Mercator frame.
Result<std::map<FrameId, Pose>> read_oxts(const std::filesystem::path& folder);

/// Times and rings that stand beside a scan (`name` is its file's), where there are any.
Status read_point_values(const std::filesystem::path& folder, const std::filesystem::path& name, Scan& scan);

}  // namespace revisit::io_internal
