// SPDX-License-Identifier: Apache-2.0
#include <revisit/mapping/earth_frame.hpp>

#include <cmath>
#include <stdexcept>

#include <gtest/gtest.h>

namespace revisit {
namespace {

GpsFix fix(double latitude_deg, double longitude_deg, double altitude_m) {
  return {0.0, latitude_deg, longitude_deg, altitude_m, Eigen::Vector3d::Ones()};
}

TEST(EarthFrame, MetresAreThoseOfTheEllipsoid) {
  const EarthFrame frame(49.0, 8.4, 110.0);
  EXPECT_LT(frame.east_north_up_m(fix(49.0, 8.4, 110.0)).norm(), 1e-6);
  // A minute of latitude at 49 degrees: the radius of the meridian there, 6,371,9xx m.
  const Eigen::Vector3d north = frame.east_north_up_m(fix(49.0 + 1.0 / 60.0, 8.4, 110.0));
  const double e2 = 6.69437999014e-3, s = std::sin(to_radians(49.0 + 0.5 / 60.0));
  const double meridian_m = 6378137.0 * (1 - e2) / std::pow(1 - e2 * s * s, 1.5) + 110.0;
  EXPECT_NEAR(north.norm(), meridian_m * to_radians(1.0 / 60.0), 0.01);
  const Eigen::Vector3d p(1234.0, -567.0, 8.9), back = frame.geodetic(p);
  EXPECT_LT((frame.east_north_up_m(fix(back.x(), back.y(), back.z())) - p).norm(), 1e-6);
}

// The central meridian of a zone: easting 500 km, the grid points north, and metres are 0.9996 of true ones.
TEST(EarthFrame, UtmHasItsZoneItsScaleAndItsNorth) {
  const EarthFrame frame(49.0, 9.0, 0.0);
  EXPECT_EQ(frame.utm_zone(), "32N");
  EXPECT_EQ(frame.epsg(), 32632);
  Pose T = Pose::Identity();
  EXPECT_NEAR(frame.to_utm(T)->translation().x(), 500000.0, 1e-3);
  EXPECT_TRUE(frame.to_utm(T)->linear().isApprox(Eigen::Matrix3d::Identity(), 1e-9));
  T.translation() << 0.0, 1000.0, 0.0;
  EXPECT_NEAR((frame.to_utm(T)->translation() - frame.to_utm(Pose::Identity())->translation()).y(), 999.6, 0.01);
  // East of it the grid's north lies to the right of true north, by the longitude's share of the latitude's sine.
  const EarthFrame east(49.0, 11.0, 0.0);
  EXPECT_NEAR(yaw_of(*east.to_utm(Pose::Identity())), to_radians(2.0) * std::sin(to_radians(49.0)), 1e-4);
  const Eigen::Vector3d at = east.to_utm(T)->translation() - east.to_utm(Pose::Identity())->translation();
  const Eigen::Vector3d turned = east.to_utm(Pose::Identity())->linear() * T.translation();
  EXPECT_LT((at - turned).norm(), 0.5) << "the axes are those of the grid";
  // Farther than a zone reaches there is no such grid, but that of the zone there.
  Pose T_far = Pose::Identity();
  T_far.translation() = frame.east_north_up_m(fix(49.0, 60.0, 0.0));
  EXPECT_FALSE(frame.to_utm(T_far));
  EXPECT_EQ(frame.with_zone_of(T_far.translation()).utm_zone(), "41N");
  EXPECT_TRUE(frame.with_zone_of(T_far.translation()).to_utm(T_far));
  EXPECT_EQ(EarthFrame(-33.9, 18.4, 0.0).epsg(), 32734);
  EXPECT_THROW(EarthFrame(91.0, 0.0, 0.0), std::invalid_argument);
  EXPECT_THROW(EarthFrame(std::nan(""), 0.0, 0.0), std::invalid_argument);
}

}  // namespace
}  // namespace revisit
