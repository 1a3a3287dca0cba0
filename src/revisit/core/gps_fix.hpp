// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

namespace revisit {

/// Where a GPS receiver was, WGS 84.
struct GpsFix {
  double stamp_s = 0.0;  ///< of the recording's clock
  double latitude_deg = 0.0, longitude_deg = 0.0;
  double altitude_m = 0.0;                                     ///< above the ellipsoid
  Eigen::Vector3d deviation_m = Eigen::Vector3d::Constant(3);  ///< standard deviation: east, north, up

  void archive(auto& fields) { fields(stamp_s, latitude_deg, longitude_deg, altitude_m, deviation_m); }
};

}  // namespace revisit
