// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <revisit/config/parameters.hpp>
#include <revisit/core/gps_fix.hpp>
#include <revisit/core/log.hpp>
#include <revisit/core/loop.hpp>
#include <revisit/core/pose.hpp>
#include <revisit/core/result.hpp>
#include <revisit/core/scan.hpp>
#include <revisit/mapping/occupancy_grid.hpp>

#include "node.hpp"

namespace revisit::node {

/// What the sensors said around a scan.
struct Moment {
  std::int64_t stamp_ns = 0;
  std::string lidar_frame, odom_frame, base_frame;
  std::optional<Pose> T_base_lidar;  ///< where tf knows it
  std::optional<Pose> T_odom_lidar;  ///< by wheels or another odometry
  bool has_odometry = false;         ///< now or before: then the map lies above it in tf
};

/// What a node does with its scans: one of three. Belongs to the node's thread.
class Mode {
 public:
  Mode() = default;
  Mode(const Mode&) = delete;
  Mode& operator=(const Mode&) = delete;
  virtual ~Mode() = default;

  virtual Status process(Scan scan, const Moment& moment) = 0;
  virtual Status add(const revisit::GpsFix&) { return ok(); }
  virtual Status expect(const Pose& /*T_map_lidar*/) { return Error{"only localise takes an initial pose"}; }
  virtual Result<std::string> save(const std::string&) { return Error{"this mode has no map to save"}; }
  virtual Result<std::string> load(const std::string&) { return Error{"only localise loads maps"}; }
  virtual Result<std::string> publish() { return Error{"this mode has no map to publish"}; }
  virtual Result<MapGrid> grid() { return Error{"this mode has no map"}; }
  /// Takes over what may change while it runs: the parameters `temporal` and `geometric`.
  virtual void set_verification(const Parameters& parameters) = 0;
  virtual Status finish() { return ok(); }
  virtual std::string state() const = 0;  ///< in a few words, for diagnostics
};

std::unique_ptr<Mode> make_detect_mode(const Parameters& parameters, Outlet& outlet, const LogSink& log);
Result<std::unique_ptr<Mode>> make_slam_mode(const Settings& settings, const Parameters& parameters, Outlet& outlet,
                                             const LogSink& log);
Result<std::unique_ptr<Mode>> make_localise_mode(const Settings& settings, const Parameters& parameters, Outlet& outlet,
                                                 const LogSink& log);

Loop message_of(const LoopConstraint& loop, const Moment& moment, std::int64_t match_stamp_ns);
MapCloud to_map_cloud(const Settings& settings, const std::vector<Point>& points);
Result<MapGrid> to_map_grid(const Settings& settings, const Result<OccupancyGrid>& grid);
/// map -> odom where there is odometry, else map -> base: what tf needs to know of a pose in the map. Nothing where
/// that would give a frame a second parent.
std::optional<Frame> map_frame_of(const Settings& settings, const Moment& moment, const Pose& T_map_lidar);
Eigen::Matrix<double, 6, 6> turned(const Pose& T, const Eigen::Matrix<double, 6, 6>& covariance);
/// The inverse of an information; directions of which nothing is known get 100 m and 10 rad.
Eigen::Matrix<double, 6, 6> covariance_of(const Matrix6& information);

}  // namespace revisit::node
