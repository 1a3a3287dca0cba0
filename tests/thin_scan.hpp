// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include <revisit/registration/surface_cloud.hpp>

#include "synthetic_world.hpp"

namespace revisit::testing_support {

/// A scan of one small world from T_world_lidar, thinned to voxels of 1 m, its ground marked.
inline ThinCloud thin_scan(const Pose& T_world_lidar, unsigned seed = 1) {
  const SyntheticWorld world(31);
  const Scan scan = world.scan(T_world_lidar, {32, 900, -24.8, 5.0}, seed);
  std::vector<std::uint8_t> ground;
  for (const Point& p : scan.points) ground.push_back(p.z < -1.6f);
  return thin(scan.points, ground, 1.0);
}

/// How far a pose lies from the truth.
inline double error_m(const Pose& T, const Pose& T_truth) { return (T_truth.inverse() * T).translation().norm(); }
inline double error_deg(const Pose& T, const Pose& T_truth) {
  return to_degrees(rotation_angle(T_truth.inverse() * T));
}

}  // namespace revisit::testing_support
