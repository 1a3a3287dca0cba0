// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <vector>

#include <revisit/core/pose.hpp>
#include <revisit/core/result.hpp>

#include "pictures/chart.hpp"

namespace revisit::cli {

/// The points of a map.ply from above, dark where many stand over each other; nothing where there is no such file.
/// `T_chart_map`: where the map lies on the chart.
Status draw_overview(Canvas& canvas, const Chart& chart, const std::filesystem::path& cloud, const Pose& T_chart_map);

/// The map from above, dark where much stands above the ground, with the trajectory on it.
Status draw_map(const std::filesystem::path& file, const std::filesystem::path& cloud,
                const std::vector<Pose>& T_world_keyframes);

}  // namespace revisit::cli
