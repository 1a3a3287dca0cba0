// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

namespace revisit {

/// One reading of an inertial measurement unit, in the frame of the LiDAR it belongs to.
struct ImuSample {
  double time_s = 0.0;  ///< from the stamp of the scan that it comes with; may be negative
  Eigen::Vector3f angular_radps = Eigen::Vector3f::Zero();
  Eigen::Vector3f acceleration_mps2 = Eigen::Vector3f::Zero();  ///< at rest, as large as gravity, and upwards

  void archive(auto& fields) { fields(time_s, angular_radps, acceleration_mps2); }
};

}  // namespace revisit
