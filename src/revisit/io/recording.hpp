// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <revisit/core/gps_fix.hpp>
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
  /// Frame and stamp of scan `index` in [0, size()); without times, 0.1 s a frame. The stamp of a bag's scan is in its
  /// message, which is read for it.
  virtual FrameId frame(std::size_t index) const = 0;
  virtual double stamp_s(std::size_t index) const = 0;
  /// The scan with its frame and stamp, or what is wrong with its file.
  virtual Result<Scan> read(std::size_t index) const = 0;

  virtual std::string kind() const = 0;  ///< e.g. "KITTI odometry folder"
  virtual bool has_times() const = 0;
  /// LiDAR poses that came with the recording, for the frames that have one; may be empty.
  virtual const Trajectory& trajectory() const = 0;
  /// What the wheels (or another odometry) said, in a frame of their own: the pose of the LiDAR at scan `index`.
  virtual bool has_wheel_odometry() const = 0;
  virtual std::optional<Pose> wheel_pose(std::size_t index) const = 0;
  /// What a GPS receiver said, in the order of its times. `topic`: of a bag, where it has several (NavSatFix).
  virtual Result<std::vector<GpsFix>> gps_fixes(const std::string& topic) const {
    (void)topic;
    return std::vector<GpsFix>();
  }
  /// Calibration of a KITTI camera, for pose files in its frame.
  virtual std::optional<Pose> T_camera_lidar() const = 0;
  /// What is known to be missing from the elevations of its sensor, or 0 (PreprocessOptions::elevation_offset_deg): the
  /// HDL-64E of KITTI, told by its own calibration files, gives them 0.205 degrees too low.
  virtual double elevation_offset_deg() const { return 0.0; }
  /// What was found and assumed about stamps, point times and other sensors: a line each, for people.
  virtual std::vector<std::string> findings() const { return {}; }
};

/// What a recording is to be taken for, where it does not say so itself. Bags and packet captures use all of it.
struct RecordingOptions {
  std::filesystem::path poses_file = {};  ///< KITTI, TUM or g2o: in place of the poses that the recording has, if any
  std::string topic = {};                 ///< of the scans or packets; needed where there are several
  std::string odometry_topic = {};        ///< likewise; "none": without
  bool use_imu = true;                    ///< where there is one whose place on the robot is known
  std::filesystem::path sensor_file =
      {};                    ///< JSON of an Ouster sensor; without, the bag or a file beside it must have it
  bool last_return = false;  ///< of dual returns, in packets; otherwise the strongest
};

/// Opens a KITTI odometry folder (velodyne/, times.txt, calib.txt, poses.txt, point times and rings if there are any),
/// a KITTI raw drive (velodyne_points/data/, oxts/), a folder of .bin, .pcd or .ply scans, with times.txt, poses.txt
/// and calib.txt in it or beside it where there are any, a ROS bag (.bag, .mcap, .db3, or a folder of these), or a
/// packet capture (.pcap). The first two may have a wheel_odometry.tum (poses of the LiDAR). Poses, times and
/// calibration that are there but broken are errors; scans are only looked at when they are read.
Result<std::unique_ptr<Recording>> open_recording(const std::filesystem::path& path, const LogSink& log = {},
                                                  const RecordingOptions& options = {});

/// Writes the scan into a KITTI odometry folder under its frame number: velodyne/NNNNNN.bin and, where it has them,
/// velodyne_times/NNNNNN.bin (float32 a point) and velodyne_rings/NNNNNN.bin (uint16), which open_recording reads back.
Status write_kitti_scan(const std::filesystem::path& folder, const Scan& scan);

/// The calibration `Tr` in a KITTI calib.txt, LiDAR to camera.
Result<Pose> read_camera_calibration(const std::filesystem::path& file);
Status write_camera_calibration(const std::filesystem::path& file, const Pose& T_camera_lidar);

}  // namespace revisit
