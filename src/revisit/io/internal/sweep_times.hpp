// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include <revisit/io/point_cloud.hpp>

namespace revisit::io_internal {

/// The times of a sweep's points, seconds from the stamp, from what a driver wrote: seconds, milli-, micro- or
/// nanoseconds, from an epoch or from the stamp, rolling over or not. A sweep lasts between a millisecond and two
/// seconds, which gives the unit; empty where none fits. Few values that stand far from all others
/// become the nearest of these.
std::vector<float> to_sweep_times(std::vector<double> raw, const std::optional<double>& stamp_s, PointTimes& times);

}  // namespace revisit::io_internal
