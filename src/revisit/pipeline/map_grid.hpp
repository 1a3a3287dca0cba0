// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <span>

#include <revisit/mapping/occupancy_grid.hpp>
#include <revisit/store/map_store.hpp>

namespace revisit {

/// What key frames of a map show from above; `poses` are theirs. `after_session`: as read_map_points() takes it.
/// `progress(done)` counts key frames and stops the work by returning false.
Result<OccupancyGrid> grid_of_map(const MapStore& store, std::span<const FrameId> keyframes,
                                  std::span<const Pose> poses, const OccupancyGrid::Options& options,
                                  std::optional<int> after_session = std::nullopt,
                                  const std::function<bool(std::size_t)>& progress = {});

}  // namespace revisit
