// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include <revisit/core/gps_fix.hpp>
#include <revisit/core/pose.hpp>

namespace revisit::simulation_internal {

/// What a receiver in the sensor says: errors of a metre or two that change within a minute; with `difficulty`, among
/// houses, jumps of 10 to 60 m for some seconds and stretches without a fix. x points east, y north.
std::vector<GpsFix> gps_fixes(const Trajectory& truth, double difficulty, std::uint64_t seed);

}  // namespace revisit::simulation_internal
