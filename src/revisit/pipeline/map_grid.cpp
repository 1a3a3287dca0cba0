// SPDX-License-Identifier: Apache-2.0
#include <revisit/pipeline/map_grid.hpp>

#include <vector>

#include <revisit/store/keyframe_bytes.hpp>

namespace revisit {

Result<OccupancyGrid> grid_of_map(const MapStore& store, std::span<const FrameId> keyframes,
                                  std::span<const Pose> poses, const OccupancyGrid::Options& options,
                                  std::optional<int> after_session, const std::function<bool(std::size_t)>& progress) {
  OccupancyGrid grid(options);
  for (std::size_t i = 0; i < keyframes.size(); ++i) {
    const auto points = read_map_points(store, keyframes[i], after_session);
    if (!points) return points.error();
    const auto bytes = store.part(keyframes[i], MapStore::Part::kPlace);
    if (!bytes) return bytes.error();
    if (progress && !progress(i + 1)) return Error{"interrupted; nothing was written"};
    if (points->empty() || bytes->empty()) continue;
    const auto place = to_thin_cloud(*bytes);
    if (!place) return store.damaged("place", keyframes[i]);
    std::vector<Eigen::Vector3f> ground;
    for (std::size_t k = 0; k < place->points.size(); ++k)
      if (place->is_ground[k] != 0) ground.push_back(place->points[k]);
    grid.add(poses[i], *points, ground);
  }
  return grid;
}

}  // namespace revisit
