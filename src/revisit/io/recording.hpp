// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include <revisit/core/log.hpp>
#include <revisit/core/pose.hpp>
#include <revisit/core/result.hpp>
#include <revisit/core/scan.hpp>

namespace revisit {

/// A sequence of scans in the order of their frame numbers, read one by one. Reading is safe from several threads.
class Recording {
 public:
  virtual ~Recording() = default;

  virtual std::size_t size() const = 0;
  /// Frame and stamp of scan `index` in [0, size()); without times, 0.1 s a frame.
  virtual FrameId frame(std::size_t index) const = 0;
  virtual double stamp_s(std::size_t index) const = 0;
  /// The scan with its frame and stamp, or what is wrong with its file.
  virtual Result<Scan> read(std::size_t index) const = 0;

  virtual std::string kind() const = 0;  ///< e.g. "KITTI odometry folder"
  virtual bool has_times() const = 0;
  /// LiDAR poses that came with the recording, for the frames that have one; may be empty.
  virtual const Trajectory& trajectory() const = 0;
  /// What the wheels said, in a frame of their own, for the frames that have it; may be empty.
  virtual const Trajectory& wheel_odometry() const = 0;
  /// Calibration of a KITTI camera, for pose files in its frame.
  virtual std::optional<Pose> T_camera_lidar() const = 0;
};

/// Opens a KITTI odometry folder (velodyne/, times.txt, calib.txt, poses.txt, point times and rings if there are any),
/// a KITTI raw drive (velodyne_points/data/, oxts/), or a folder of .bin, .pcd or .ply scans, with times.txt, poses.txt
/// and calib.txt in it or beside it where there are any. The first two may have a wheel_odometry.tum (poses of the
/// LiDAR). Poses, times and calibration that are there but broken are errors; scans are only looked at when they are
/// read. `poses_file` (KITTI, TUM or g2o) stands in for the poses that the folder has, if any.
Result<std::unique_ptr<Recording>> open_recording(const std::filesystem::path& folder, const LogSink& log = {},
                                                  const std::filesystem::path& poses_file = {});

/// Writes the scan into a KITTI odometry folder under its frame number: velodyne/NNNNNN.bin and, where it has them,
/// velodyne_times/NNNNNN.bin (float32 a point) and velodyne_rings/NNNNNN.bin (uint16), which open_recording reads back.
Status write_kitti_scan(const std::filesystem::path& folder, const Scan& scan);

/// The calibration `Tr` in a KITTI calib.txt, LiDAR to camera.
Result<Pose> read_camera_calibration(const std::filesystem::path& file);
Status write_camera_calibration(const std::filesystem::path& file, const Pose& T_camera_lidar);

}  // namespace revisit
