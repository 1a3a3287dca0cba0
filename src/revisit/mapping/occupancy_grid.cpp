// SPDX-License-Identifier: Apache-2.0
#include <revisit/mapping/occupancy_grid.hpp>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>
#include <map>
#include <optional>
#include <vector>

namespace revisit {
namespace {

// The ground around a key frame, in the map: the mean height of its points in squares of 2 m; where there are none,
// that of the nearest square that has some.
class GroundAround {
 public:
  GroundAround(const Pose& T_map_lidar, std::span<const Eigen::Vector3f> ground, double range_m) {
    std::map<std::pair<int, int>, std::pair<double, int>> sums;
    for (const Eigen::Vector3f& each : ground) {
      if (static_cast<double>(each.norm()) > range_m) continue;
      const Eigen::Vector3d p = T_map_lidar * each.cast<double>();
      auto& [sum, count] = sums[square(p.x(), p.y())];
      sum += p.z();
      ++count;
    }
    for (const auto& [at, sum] : sums) heights_[at] = sum.first / sum.second;
  }
  std::optional<double> height(double x, double y) const {
    const auto [column, row] = square(x, y);
    for (int reach = 0; reach <= kReach; ++reach)
      for (int i = -reach; i <= reach; ++i)
        for (int j = -reach; j <= reach; ++j)
          if (const auto found = heights_.find({column + i, row + j});
              std::max(std::abs(i), std::abs(j)) == reach && found != heights_.end())
            return found->second;
    return std::nullopt;
  }

 private:
  static constexpr double kSquare_m = 2.0;
  static constexpr int kReach = 4;
  static std::pair<int, int> square(double x, double y) {
    return {static_cast<int>(std::floor(x / kSquare_m)), static_cast<int>(std::floor(y / kSquare_m))};
  }
  std::map<std::pair<int, int>, double> heights_;
};

}  // namespace

OccupancyGrid::Key OccupancyGrid::key(const Eigen::Vector3d& p) const {
  return {static_cast<int>(std::floor(p.x() / options_.cell_m)), static_cast<int>(std::floor(p.y() / options_.cell_m))};
}

void OccupancyGrid::add(const Pose& T_map_lidar, std::span<const Point> points,
                        std::span<const Eigen::Vector3f> ground) {
  const GroundAround around(T_map_lidar, ground, options_.range_m);
  const Key sensor = key(T_map_lidar.translation());
  std::vector<Key> obstacles, ends;
  for (const Point& each : points) {
    const Eigen::Vector3d in_lidar = Eigen::Vector3f(each.x, each.y, each.z).cast<double>();
    if (in_lidar.norm() > options_.range_m) continue;
    const Eigen::Vector3d p = T_map_lidar * in_lidar;
    const auto ground_m = around.height(p.x(), p.y());
    if (!ground_m) continue;
    const double above_m = p.z() - *ground_m;
    if (above_m >= options_.height_m) continue;
    ends.push_back(key(p));
    if (above_m > options_.clearance_m) obstacles.push_back(key(p));
  }
  for (std::vector<Key>* each : {&obstacles, &ends}) {
    std::sort(each->begin(), each->end());
    each->erase(std::unique(each->begin(), each->end()), each->end());
  }
  for (const Key& obstacle : obstacles) ++cells_[obstacle].obstacle;
  // Over what lies lower than the clearance it was seen, up to what stands in the way.
  for (const Key& end : ends) see_over(sensor, end);
}

// Bresenham's line; the last cell is left out.
void OccupancyGrid::see_over(const Key& from, const Key& to) {
  std::int32_t x = from.x, y = from.y;
  const int dx = std::abs(to.x - x), dy = -std::abs(to.y - y);
  const int step_x = x < to.x ? 1 : -1, step_y = y < to.y ? 1 : -1;
  for (int error = dx + dy; x != to.x || y != to.y;) {
    ++cells_[{x, y}].through;
    const int twice = 2 * error;
    if (twice >= dy) {
      error += dy;
      x += step_x;
    }
    if (twice <= dx) {
      error += dx;
      y += step_y;
    }
  }
}

// Rays pass beside and over an obstacle's cell, too: it counts once a key frame, they as often as they pass.
OccupancyGrid::Cell OccupancyGrid::verdict(const Seen& seen) {
  constexpr double kPassesAnObstacle = 12.0;
  if (static_cast<double>(seen.obstacle) * kPassesAnObstacle > static_cast<double>(seen.through))
    return Cell::kOccupied;
  return seen.through > 0 ? Cell::kFree : Cell::kUnknown;
}

OccupancyGrid::Cell OccupancyGrid::at(double x_m, double y_m) const {
  const auto found = cells_.find(key({x_m, y_m, 0.0}));
  return found == cells_.end() ? Cell::kUnknown : verdict(found->second);
}

Result<OccupancyGrid::Image> OccupancyGrid::image() const {
  if (cells_.empty()) return Error{"the map shows no ground to drive on"};
  int low_x = std::numeric_limits<int>::max(), low_y = low_x, high_x = std::numeric_limits<int>::min(), high_y = high_x;
  for (const auto& [cell, seen] : cells_) {
    low_x = std::min(low_x, cell.x);
    high_x = std::max(high_x, cell.x);
    low_y = std::min(low_y, cell.y);
    high_y = std::max(high_y, cell.y);
  }
  Image image;
  image.width = static_cast<std::size_t>(std::int64_t{high_x} - low_x + 1);
  image.height = static_cast<std::size_t>(std::int64_t{high_y} - low_y + 1);
  constexpr std::size_t kMostCells = 2'000'000'000;
  if (image.width > kMostCells / image.height)
    return Error{std::to_string(image.width) + " x " + std::to_string(image.height) + " cells; allowed: up to " +
                 std::to_string(kMostCells) + " (larger cells need fewer)"};
  image.x_m = low_x * options_.cell_m;
  image.y_m = low_y * options_.cell_m;
  image.cells.resize(image.width * image.height);
  for (const auto& [cell, seen] : cells_)
    image.cells[static_cast<std::size_t>(cell.y - low_y) * image.width + static_cast<std::size_t>(cell.x - low_x)] =
        verdict(seen);
  return image;
}

Status OccupancyGrid::write(const std::filesystem::path& yaml_file) const {
  const auto image = this->image();
  if (!image) return Error{yaml_file.string() + ": " + image.error().message};
  std::filesystem::path pgm_file = yaml_file;
  pgm_file.replace_extension(".pgm");
  std::ofstream pgm(pgm_file, std::ios::binary | std::ios::trunc);
  pgm << "P5\n# revisit: occupancy\n" << image->width << ' ' << image->height << "\n255\n";
  const auto grey = [](Cell cell) { return cell == Cell::kOccupied ? '\0' : cell == Cell::kFree ? '\xfe' : '\xcd'; };
  std::string line(image->width, '\0');
  for (std::size_t row = image->height; row-- > 0;) {  // from the top, where y is largest
    const auto first = image->cells.begin() + static_cast<std::ptrdiff_t>(row * image->width);
    std::transform(first, first + static_cast<std::ptrdiff_t>(image->width), line.begin(), grey);
    pgm << line;
  }
  pgm.close();
  std::ofstream yaml(yaml_file, std::ios::trunc);
  yaml << "image: " << pgm_file.filename().string() << "\nmode: trinary\nresolution: " << options_.cell_m
       << "\norigin: [" << image->x_m << ", " << image->y_m
       << ", 0.0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n";
  yaml.close();
  if (!pgm) return Error{pgm_file.string() + ": cannot be written"};
  if (!yaml) return Error{yaml_file.string() + ": cannot be written"};
  return ok();
}

}  // namespace revisit
