// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include <revisit/core/imu.hpp>
#include <revisit/simulation/internal/scanner.hpp>

namespace revisit::simulation_internal {

/// What an inexpensive IMU in the LiDAR's housing reads, 200 times a second, from `from_s` to `to_s` of the drive;
/// times from `stamp_s`. The same seed and time give the same reading.
std::vector<ImuSample> imu_samples(const Scanner& scanner, std::uint64_t seed, double stamp_s, double from_s,
                                   double to_s);

}  // namespace revisit::simulation_internal
