// SPDX-License-Identifier: Apache-2.0
#include "mode.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>
#include <vector>

#include <Eigen/LU>

namespace revisit::node {

Loop message_of(const LoopConstraint& loop, const Moment& moment, std::int64_t match_stamp_ns) {
  const Eigen::Matrix<double, 6, 6> covariance = covariance_of(loop.information);
  return {moment.stamp_ns,
          match_stamp_ns,
          in_recording(loop.query).value,
          in_recording(loop.match).value,
          moment.lidar_frame,
          loop.T_match_query,
          covariance,
          turned(loop.T_match_query, covariance),
          loop.probability};
}

std::optional<Frame> map_frame_of(const Settings& settings, const Moment& moment, const Pose& T_map_lidar) {
  if (moment.T_odom_lidar)
    return Frame{moment.stamp_ns, settings.map_frame, moment.odom_frame,
                 normalised(T_map_lidar * moment.T_odom_lidar->inverse())};
  if (moment.has_odometry || !moment.T_base_lidar) return std::nullopt;
  return Frame{moment.stamp_ns, settings.map_frame, moment.base_frame,
               normalised(T_map_lidar * moment.T_base_lidar->inverse())};
}

Eigen::Matrix<double, 6, 6> turned(const Pose& T, const Eigen::Matrix<double, 6, 6>& covariance) {
  Eigen::Matrix<double, 6, 6> turn = Eigen::Matrix<double, 6, 6>::Zero();
  turn.topLeftCorner<3, 3>() = turn.bottomRightCorner<3, 3>() = T.linear();
  return turn * covariance * turn.transpose();
}

Eigen::Matrix<double, 6, 6> covariance_of(const Matrix6& information) {
  Vector6 least;
  least << 1e-4, 1e-4, 1e-4, 1e-2, 1e-2, 1e-2;
  const Matrix6 covariance = (information + Matrix6(least.asDiagonal())).inverse();
  return 0.5 * (covariance + covariance.transpose());
}

Result<MapGrid> to_map_grid(const Settings& settings, const Result<OccupancyGrid>& grid) {
  if (!grid) return grid.error();
  const auto image = grid->image();
  if (!image) return image.error();
  MapGrid message{settings.map_frame,
                  grid->cell_m(),
                  image->x_m,
                  image->y_m,
                  static_cast<std::uint32_t>(image->width),
                  static_cast<std::uint32_t>(image->height),
                  {}};
  message.cells.reserve(image->cells.size());
  for (const OccupancyGrid::Cell cell : image->cells)
    message.cells.push_back(cell == OccupancyGrid::Cell::kFree       ? std::int8_t{0}
                            : cell == OccupancyGrid::Cell::kOccupied ? std::int8_t{100}
                                                                     : std::int8_t{-1});
  return message;
}

MapCloud to_map_cloud(const Settings& settings, const std::vector<Point>& points) {
  const auto add = [](std::vector<float>& to, const Point& p) { to.insert(to.end(), {p.x, p.y, p.z, p.intensity}); };
  MapCloud cloud{settings.map_frame, {}, {}};
  const std::size_t step =
      std::max<std::size_t>(1, (points.size() + MapCloud::kOverviewPoints - 1) / MapCloud::kOverviewPoints);
  cloud.overview.reserve(4 * (points.size() / step + 1));
  for (std::size_t i = 0; i < points.size(); i += step) add(cloud.overview, points[i]);
  std::map<std::pair<int, int>, std::vector<float>> tiles;
  const auto tile = [](float metres) { return static_cast<int>(std::floor(metres / MapCloud::kTileM)); };
  constexpr float kFarthest_m = 1e6f;  // nothing is there, and the number of a tile must fit
  for (const Point& p : points)
    if (std::abs(p.x) < kFarthest_m && std::abs(p.y) < kFarthest_m) add(tiles[{tile(p.x), tile(p.y)}], p);
  cloud.tiles.reserve(tiles.size());
  for (auto& [where, inside] : tiles) cloud.tiles.push_back(std::move(inside));
  return cloud;
}

}  // namespace revisit::node
