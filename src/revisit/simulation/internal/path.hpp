// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <vector>

#include <Eigen/Core>

#include <revisit/core/log.hpp>
#include <revisit/core/result.hpp>

namespace revisit::simulation_internal {

/// Where the vehicle is, seen from above. World: x, y level, z up, metres.
struct Knot {
  double x = 0.0, y = 0.0, yaw_rad = 0.0;
  double ground_z = 0.0;
};

/// The way of a vehicle over time, a knot each 0.1 s; between knots a smooth curve through them.
class Path {
 public:
  static constexpr double kStep_s = 0.1;

  Path() = default;
  explicit Path(std::vector<Knot> knots);

  const std::vector<Knot>& knots() const { return knots_; }
  double duration_s() const { return kStep_s * static_cast<double>(knots_.size() - 1); }
  /// The same way from elsewhere.
  Path moved(const Eigen::Vector3d& by) const;
  /// The part from `from_m` to `to_m` of its length, `left_m` to the left of it, driven the other way round if
  /// `reverse`; empty where fewer than two knots are in it.
  Path part(double from_m, double to_m, double left_m, bool reverse) const;
  double length_m() const { return arc_m_.back(); }
  /// At `time_s` from the first knot; beyond the ends it goes on straight.
  Knot at(double time_s) const;
  /// Metres driven until `time_s`, within the path.
  double arc_at(double time_s) const;
  /// The place after `arc_m` metres, within the path, with the heading of travel; `left_m` to the left of it.
  Knot beside(double arc_m, double left_m) const;

 private:
  std::vector<Knot> knots_;
  std::vector<double> arc_m_;  ///< driven until each knot
};

/// The path in a pose file. KITTI poses of a camera (z forward) and of a LiDAR are told apart by the direction of
/// travel. Frames count 0.1 s where the file has no times. Where rotations cannot be used, the heading is that of
/// travel, which is logged. Errors: one pose, NaN or missing poses, jumps, times that do not increase.
Result<Path> read_path(const std::filesystem::path& file, const LogSink& log);

struct Driving {
  double speed_mps = 10.0, corner_speed_mps = 4.0, acceleration_mps2 = 1.8, corner_radius_m = 7.0;
};

/// The knots of driving along the corners, rounded, braking before and accelerating behind them.
std::vector<Knot> drive(const std::vector<Eigen::Vector2d>& corners, const Driving& driving);

}  // namespace revisit::simulation_internal
