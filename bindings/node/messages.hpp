// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

/// What ROS messages hold, without ROS. C++17, since the message headers of ROS 1 are.
namespace revisit::node {

using Transform3 = Eigen::Isometry3d;

/// Of a message's position and quaternion: not finite where these are none.
inline Transform3 to_transform(const Eigen::Vector3d& position, const Eigen::Quaterniond& rotation) {
  Transform3 T = Transform3::Identity();
  T.translation() = position;
  const double off = std::abs(rotation.norm() - 1.0);
  T.linear() = off < 1e-2 ? rotation.normalized().toRotationMatrix()
                          : Eigen::Matrix3d(Eigen::Matrix3d::Constant(std::numeric_limits<double>::quiet_NaN()));
  return T;
}

/// sensor_msgs/PointCloud2; or any message with a scan as it went over the wire, where `type` names it: then `data` is
/// the whole message and the rest is in it.
struct Cloud {
  struct Field {
    std::string name;
    std::uint32_t offset = 0;
    std::uint8_t type = 0;  ///< sensor_msgs/PointField
  };
  std::int64_t stamp_ns = 0;
  std::string frame_id;
  std::vector<Field> fields;
  std::uint32_t width = 0, height = 0, point_step = 0, row_step = 0;
  bool is_big_endian = false;
  const std::uint8_t* data = nullptr;
  std::size_t size = 0;
  std::shared_ptr<const void> owner;  ///< of the data
  std::string type, definition;       ///< as ScanMessageReader takes them
  bool is_ros1 = false;               ///< how the message was written; otherwise as CDR
};

/// sensor_msgs/Imu.
struct Imu {
  std::int64_t stamp_ns = 0;
  std::string frame_id;
  Eigen::Vector3d angular_radps = Eigen::Vector3d::Zero(), acceleration_mps2 = Eigen::Vector3d::Zero();
};

/// nav_msgs/Odometry.
struct Odometry {
  std::int64_t stamp_ns = 0;
  std::string frame_id, child_frame_id;
  Transform3 T_odom_child = Transform3::Identity();
};

/// sensor_msgs/NavSatFix, of one that is a fix. Deviations: east, north, up; 0 where nothing is known.
struct GpsFix {
  std::int64_t stamp_ns = 0;
  double latitude_deg = 0.0, longitude_deg = 0.0, altitude_m = 0.0;
  Eigen::Vector3d deviation_m = Eigen::Vector3d::Zero();
};

/// geometry_msgs/PoseWithCovarianceStamped of /initialpose: somebody says where the robot is.
struct InitialPose {
  std::string frame_id;
  Transform3 T_map_base = Transform3::Identity();
};

/// Two scans of one place. Covariance: metres, then radians, in the query's frame.
struct Loop {
  std::int64_t query_stamp_ns = 0, match_stamp_ns = 0, query = 0, match = 0;
  std::string lidar_frame;
  Transform3 T_match_query = Transform3::Identity();
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
  Eigen::Matrix<double, 6, 6> covariance_about_match = covariance;  ///< about the axes of the match
  double probability = 0.0;
};

/// geometry_msgs/TransformStamped, for tf.
struct Frame {
  std::int64_t stamp_ns = 0;
  std::string parent, child;
  Transform3 T_parent_child = Transform3::Identity();
};

/// Where the LiDAR is in the map.
struct MapPose {
  std::int64_t stamp_ns = 0;
  std::string map_frame;
  Transform3 T_map_lidar = Transform3::Identity();
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();  ///< about the axes of the map
};

/// The trajectory and the pose graph as they are now.
struct Graph {
  std::string map_frame;
  std::vector<std::pair<std::int64_t, Transform3>> path;   ///< stamp and pose of each key frame
  std::vector<std::pair<std::size_t, std::size_t>> loops;  ///< key frames, as the path counts them
};

/// The map's points: x y z intensity.
struct MapCloud {
  std::string map_frame;
  std::vector<float> overview;                               ///< at most kOverviewPoints, spread evenly over the map
  std::vector<std::vector<float>> tiles;                     ///< all points, by squares of kTileM on the ground plane
  static constexpr std::size_t kOverviewPoints = 2'000'000;  // one message of 32 MB
  static constexpr double kTileM = 50.0;
};

/// nav_msgs/OccupancyGrid: what may be driven over.
struct MapGrid {
  std::string map_frame;
  double cell_m = 0.0, x_m = 0.0, y_m = 0.0;  ///< of the lower left corner
  std::uint32_t width = 0, height = 0;
  std::vector<std::int8_t> cells;  ///< row by row, from the lowest y: 0 free, 100 occupied, -1 unknown
};

/// diagnostic_msgs/DiagnosticStatus.
struct Health {
  enum Level : std::uint8_t { kOk, kWarning, kError } level = kOk;
  std::string message;
  std::vector<std::pair<std::string, std::string>> values;
};

}  // namespace revisit::node
