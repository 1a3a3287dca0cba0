// SPDX-License-Identifier: Apache-2.0
#include <revisit/simulation/internal/gps_model.hpp>

#include <GeographicLib/LocalCartesian.hpp>

#include <revisit/simulation/internal/random.hpp>

namespace revisit::simulation_internal {
namespace {

struct Receiver {
  static constexpr double kLatitude_deg = 49.0, kLongitude_deg = 8.4, kAltitude_m = 160.0;  ///< of the world's origin
  static constexpr int kEvery_scans = 2;
  static constexpr double kSlow_m = 1.0, kSlow_s = 40.0, kFast_m = 0.2, kUpward = 1.7;
  static constexpr double kStretch_s = 30.0;  ///< in each of which there may be a jump, or nothing
  static constexpr double kLeastJump_m = 10.0, kMostJump_m = 60.0;
};

}  // namespace

std::vector<GpsFix> gps_fixes(const Trajectory& truth, double difficulty, std::uint64_t seed) {
  const GeographicLib::LocalCartesian earth(Receiver::kLatitude_deg, Receiver::kLongitude_deg, Receiver::kAltitude_m);
  std::vector<GpsFix> fixes;
  for (const auto& [frame, entry] : truth.entries) {
    if (frame.value % Receiver::kEvery_scans != 0) continue;
    const auto stretch = static_cast<std::uint64_t>(entry.stamp_s / Receiver::kStretch_s);
    const double within = entry.stamp_s / Receiver::kStretch_s - static_cast<double>(stretch);
    const double chance = static_cast<double>(uniform(mix(seed, stretch, 101)));
    const bool is_short = within < 0.3;
    if (is_short && chance < 0.2 * difficulty) continue;  // without a fix
    Eigen::Vector3d p = entry.T_world_lidar.translation();
    for (int axis = 0; axis < 3; ++axis) {
      const auto number = static_cast<std::uint64_t>(axis);
      const double error_m =
          Receiver::kSlow_m * 2.0 * smooth_noise(mix(seed, 102, number), entry.stamp_s / Receiver::kSlow_s) +
          Receiver::kFast_m *
              static_cast<double>(gaussian(mix(mix(seed, 103, number), static_cast<std::uint64_t>(frame.value))));
      p[axis] += axis == 2 ? Receiver::kUpward * error_m : error_m;
    }
    if (is_short && chance > 1.0 - 0.3 * difficulty) {
      const double far_m = Receiver::kLeastJump_m + (Receiver::kMostJump_m - Receiver::kLeastJump_m) *
                                                        static_cast<double>(uniform(mix(seed, stretch, 104)));
      const double heading_rad = 2.0 * kPi * static_cast<double>(uniform(mix(seed, stretch, 105)));
      p += far_m * Eigen::Vector3d(std::cos(heading_rad), std::sin(heading_rad), 0.5);
    }
    GpsFix fix{entry.stamp_s, 0, 0, 0, Eigen::Vector3d(1.2, 1.2, 2.0)};
    earth.Reverse(p.x(), p.y(), p.z(), fix.latitude_deg, fix.longitude_deg, fix.altitude_m);
    fixes.push_back(fix);
  }
  return fixes;
}

}  // namespace revisit::simulation_internal
