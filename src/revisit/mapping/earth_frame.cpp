// SPDX-License-Identifier: Apache-2.0
#include <revisit/mapping/earth_frame.hpp>

#include <cmath>
#include <stdexcept>

#include <GeographicLib/LocalCartesian.hpp>
#include <GeographicLib/UTMUPS.hpp>

namespace revisit {
namespace {

GeographicLib::LocalCartesian frame_at(const EarthFrame& frame) {
  return {frame.latitude_deg(), frame.longitude_deg(), frame.altitude_m()};
}

}  // namespace

EarthFrame::EarthFrame(double latitude_deg, double longitude_deg, double altitude_m)
    : latitude_deg_(latitude_deg), longitude_deg_(longitude_deg), altitude_m_(altitude_m) {
  if (!(std::abs(latitude_deg) <= 90.0) || !(std::abs(longitude_deg) <= 540.0) || !std::isfinite(altitude_m))
    throw std::invalid_argument("no place on the earth: latitude " + std::to_string(latitude_deg) + ", longitude " +
                                std::to_string(longitude_deg));
  zone_ = GeographicLib::UTMUPS::StandardZone(latitude_deg, longitude_deg);
  is_north_ = latitude_deg >= 0.0;
}

Eigen::Vector3d EarthFrame::east_north_up_m(const GpsFix& fix) const {
  Eigen::Vector3d p;
  frame_at(*this).Forward(fix.latitude_deg, fix.longitude_deg, fix.altitude_m, p.x(), p.y(), p.z());
  return p;
}

Eigen::Vector3d EarthFrame::geodetic(const Eigen::Vector3d& p) const {
  Eigen::Vector3d result;
  frame_at(*this).Reverse(p.x(), p.y(), p.z(), result.x(), result.y(), result.z());
  return result;
}

EarthFrame EarthFrame::with_zone_of(const Eigen::Vector3d& east_north_up_m) const {
  const Eigen::Vector3d at = geodetic(east_north_up_m);
  EarthFrame result = *this;
  result.zone_ = GeographicLib::UTMUPS::StandardZone(at.x(), at.y());
  result.is_north_ = at.x() >= 0.0;
  return result;
}

std::optional<Pose> EarthFrame::to_utm(const Pose& T_earth) const {
  const Eigen::Vector3d at = geodetic(T_earth.translation());
  int zone = 0;
  bool is_north = true;
  double easting_m = 0.0, northing_m = 0.0, convergence_deg = 0.0, scale = 1.0;
  try {
    GeographicLib::UTMUPS::Forward(at.x(), at.y(), zone, is_north, easting_m, northing_m, convergence_deg, scale,
                                   zone_);
  } catch (const GeographicLib::GeographicErr&) {
    return std::nullopt;
  }
  // A map that crosses the equator has one grid.
  if (is_north != is_north_) northing_m += is_north ? 1e7 : -1e7;
  Pose T = Pose::Identity();
  T.linear() =
      Eigen::AngleAxisd(to_radians(convergence_deg), Eigen::Vector3d::UnitZ()).toRotationMatrix() * T_earth.linear();
  T.translation() << easting_m, northing_m, at.z();
  return T;
}

std::string EarthFrame::utm_zone() const { return std::to_string(zone_) + (is_north_ ? "N" : "S"); }

int EarthFrame::epsg() const { return GeographicLib::UTMUPS::EncodeEPSG(zone_, is_north_); }

}  // namespace revisit
