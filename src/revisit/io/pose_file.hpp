// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <revisit/core/exclusion.hpp>
#include <revisit/core/pose.hpp>
#include <revisit/core/result.hpp>

namespace revisit {

enum class PoseFormat { kKitti, kTum, kG2o };

/// One pose as its file gives it: KITTI and g2o know the frame, TUM the time.
struct PoseRow {
  std::optional<FrameId> frame;
  std::optional<double> stamp_s;
  Pose T_world_body = Pose::Identity();
};

struct PoseFile {
  PoseFormat format = PoseFormat::kKitti;
  std::size_t rows_without_pose = 0;  ///< KITTI rows of NaN, which are left out
  std::vector<PoseRow> rows;
};

/// Reads KITTI (12 numbers a row, the row is the frame; or 13, the frame first), TUM (time x y z qx qy qz qw) or g2o
/// (VERTEX_SE3:QUAT); the form is recognised by content. KITTI rows of NaN are frames without a pose and are left out.
/// A row that is no rigid transform is an error that names file and line.
Result<PoseFile> read_poses(const std::filesystem::path& file);

struct TimedPosition {
  double stamp_s = 0.0;
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();
};
/// Times and positions of a TUM file whose rotations cannot be used.
Result<std::vector<TimedPosition>> read_tum_positions(const std::filesystem::path& file);

/// Row i holds frame i, from 0 to the last frame with a pose; frames without one are rows of NaN.
/// The poses are written in the camera frame where `T_camera_lidar` is given: T_c0_ci = Tr T_l0_li Tr^-1.
Status write_kitti_poses(const std::filesystem::path& file, const Trajectory& trajectory,
                         const std::optional<Pose>& T_camera_lidar);
Status write_tum_poses(const std::filesystem::path& file, const Trajectory& trajectory);
Status write_g2o_poses(const std::filesystem::path& file, const Trajectory& trajectory);

/// LiDAR poses by frame. KITTI poses of a camera become LiDAR poses through `T_camera_lidar`; TUM poses are taken at
/// the time of each frame of `stamps`: interpolated between rows at most twice `max_gap_s` apart, else the nearer row
/// within `max_gap_s`.
Trajectory to_trajectory(const PoseFile& poses, const std::optional<Pose>& T_camera_lidar,
                         const std::vector<FrameTime>& stamps, double max_gap_s = 0.05);

}  // namespace revisit
