// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include <revisit/core/pose.hpp>

namespace revisit::simulation_internal {

/// What the wheels say: a flat path from the first pose on, with a wrong wheel size, a drifting gyro, noise, and
/// stretches on which the wheels slip.
Trajectory wheel_odometry(const Trajectory& truth, std::uint64_t seed);
/// What a scan-to-scan odometry says: six degrees of freedom that drift away slowly.
Trajectory drifting_odometry(const Trajectory& truth, std::uint64_t seed);

}  // namespace revisit::simulation_internal
