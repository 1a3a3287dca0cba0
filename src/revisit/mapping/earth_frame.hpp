// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include <revisit/core/gps_fix.hpp>
#include <revisit/core/pose.hpp>

namespace revisit {

/// Coordinates in metres east, north and up of a point of the earth (WGS 84). Safe to share between threads.
class EarthFrame {
 public:
  /// Throws std::invalid_argument for a latitude beyond 90 or a longitude beyond 540 degrees.
  EarthFrame(double latitude_deg, double longitude_deg, double altitude_m);

  double latitude_deg() const { return latitude_deg_; }
  double longitude_deg() const { return longitude_deg_; }
  double altitude_m() const { return altitude_m_; }

  Eigen::Vector3d east_north_up_m(const GpsFix& fix) const;
  /// Latitude and longitude in degrees, altitude in metres.
  Eigen::Vector3d geodetic(const Eigen::Vector3d& east_north_up_m) const;

  /// The same frame with the UTM zone in which a point of it lies, instead of that of its origin.
  EarthFrame with_zone_of(const Eigen::Vector3d& east_north_up_m) const;
  /// The same pose in the grid of the UTM zone: easting, northing, altitude above the
  /// ellipsoid; its axes are those of the grid. Metres at the pose are those of the grid to 0.04 %.
  /// Nothing where the pose is far out of the zone.
  std::optional<Pose> to_utm(const Pose& T_earth) const;
  std::string utm_zone() const;  ///< "32N"
  int epsg() const;              ///< of the zone, WGS 84

 private:
  double latitude_deg_, longitude_deg_, altitude_m_;
  int zone_ = 0;
  bool is_north_ = true;
};

}  // namespace revisit
