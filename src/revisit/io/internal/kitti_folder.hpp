// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include <revisit/core/gps_fix.hpp>
#include <revisit/core/pose.hpp>
#include <revisit/core/result.hpp>
#include <revisit/core/scan.hpp>

namespace revisit::io_internal {

/// Row `key` of a KITTI calib.txt, 3 x 4, e.g. "Tr" (LiDAR to camera 0).
Result<Pose> read_kitti_calibration(const std::filesystem::path& file, const std::string& key);

/// Whether the cameras of a calib.txt or a calib_cam_to_cam.txt are those of KITTI's car, as the focal length of the
/// first one tells: others write their recordings in its layout, too.
bool is_calibration_of_kitti(const std::filesystem::path& file);

/// The rows R: and T: of KITTI raw's calib_imu_to_velo.txt.
Result<Pose> read_kitti_raw_calibration(const std::filesystem::path& file);

/// times.txt (one number a row) or KITTI raw timestamps.txt (date and time a row), seconds; row i belongs to frame i.
Result<std::vector<double>> read_times(const std::filesystem::path& file);
Result<std::vector<double>> read_timestamps(const std::filesystem::path& file);

/// What KITTI raw's GPS and IMU said of themselves.
struct Oxts {
  Pose T_world_imu = Pose::Identity();  ///< in a local Mercator frame: x east, y north
  GpsFix fix;                           ///< of the IMU, without stamp
  /// The same of a sensor that stands so in the IMU's frame.
  GpsFix fix_of(const Eigen::Vector3d& sensor_in_imu_m) const;
};
/// The rows of a KITTI raw `oxts` folder, by the number in the file's name.
Result<std::map<FrameId, Oxts>> read_oxts(const std::filesystem::path& folder);

/// Times and rings that stand in `folder` beside the scan of that file, where there are any: one for each of the scan's
/// points, or of the file's, of which some are no returns.
Status read_point_values(const std::filesystem::path& folder, const std::filesystem::path& scan_file, Scan& scan);

}  // namespace revisit::io_internal
