// SPDX-License-Identifier: Apache-2.0
#include <revisit/mapping/build_map.hpp>

#include <algorithm>
#include <array>
#include <cstdint>
#include <deque>
#include <optional>

#include <tbb/parallel_for.h>

#include <revisit/mapping/cloud_file.hpp>
#include <revisit/mapping/internal/moving_points.hpp>
#include <revisit/mapping/internal/tile_files.hpp>
#include <revisit/mapping/tileset_writer.hpp>

namespace revisit {
namespace {

namespace fs = std::filesystem;
using mapping_internal::find_moving;
using mapping_internal::Observer;
using mapping_internal::one_point_a_voxel;
using mapping_internal::TileFiles;
using mapping_internal::TileIndex;
using mapping_internal::VisibilityImage;

// Key frames before and after that say whether a point stayed: soon enough to see it, late enough that it has moved.
constexpr std::array kObservers = {-12, -8, -4, -2, 2, 4, 8, 12};
constexpr int kReach = 12;

struct Loaded {
  std::vector<Point> points;
  VisibilityImage image;
};

// The key frames around the one at work, each read once.
class Window {
 public:
  explicit Window(const std::function<Result<std::vector<Point>>(std::size_t)>& points) : points_(points) {}
  Status move_to(std::size_t centre, std::size_t count) {
    while (first_ + kReach < centre) {
      loaded_.pop_front();
      ++first_;
    }
    while (first_ + loaded_.size() < std::min(count, centre + kReach + 1)) {
      auto points = points_(first_ + loaded_.size());
      if (!points) return points.error();
      VisibilityImage image(*points);
      loaded_.push_back({*std::move(points), std::move(image)});
    }
    return ok();
  }
  const Loaded& at(std::size_t i) const { return loaded_[i - first_]; }

 private:
  const std::function<Result<std::vector<Point>>(std::size_t)>& points_;
  std::deque<Loaded> loaded_;
  std::size_t first_ = 0;
};

std::vector<Point> placed(const std::vector<Point>& points, const std::vector<std::uint8_t>& leave_out,
                          const Pose& T_world_lidar) {
  std::vector<Point> result;
  result.reserve(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!leave_out.empty() && leave_out[i] != 0) continue;
    const Eigen::Vector3f p = (T_world_lidar * Eigen::Vector3d(points[i].x, points[i].y, points[i].z)).cast<float>();
    result.push_back({p.x(), p.y(), p.z(), points[i].intensity});
  }
  return result;
}

enum class Next { kGoOn, kStop };

// Calls `take(points, done)` with the points of each key frame in the world's frame, without what moved.
template <typename Take>
Status for_each_keyframe(const MapInput& input, const MapOptions& options, std::size_t& moving, Take take) {
  Window window(input.points);
  const auto& poses = input.T_world_keyframes;
  const std::size_t count = poses.size();
  for (std::size_t i = 0; i < count; ++i) {
    if (const Status status = window.move_to(i, count); !status) return status;
    const std::vector<Point>& own = window.at(i).points;
    std::vector<std::uint8_t> is_moving;
    if (options.thin_moving) {
      std::vector<Observer> observers;
      for (const int offset : kObservers)
        if (const auto j = static_cast<std::int64_t>(i) + offset; j >= 0 && j < static_cast<std::int64_t>(count))
          if (const auto k = static_cast<std::size_t>(j); !window.at(k).points.empty())
            observers.push_back({poses[k], &window.at(k).image});
      is_moving = find_moving(own, poses[i], observers);
      moving += static_cast<std::size_t>(std::count(is_moving.begin(), is_moving.end(), 1));
    }
    if (take(placed(own, is_moving, poses[i]), i + 1) == Next::kStop) return ok();
  }
  return ok();
}

std::vector<MapPoint> labelled(const std::vector<Point>& points, const MapInput& input, std::size_t keyframe) {
  const std::size_t last = std::max<std::size_t>(1, input.T_world_keyframes.size() - 1);
  const auto time = static_cast<std::uint16_t>(keyframe * UINT16_MAX / last);
  const auto session = static_cast<std::uint16_t>(input.sessions.empty() ? 0 : input.sessions[keyframe]);
  std::vector<MapPoint> result;
  result.reserve(points.size());
  for (const Point& p : points) result.push_back({p.x, p.y, p.z, p.intensity, session, time});
  return result;
}

std::vector<Point> without_labels(const std::vector<MapPoint>& points) {
  std::vector<Point> result;
  result.reserve(points.size());
  for (const MapPoint& p : points) result.push_back({p.x, p.y, p.z, p.intensity});
  return result;
}

// What is known once all squares are thinned.
struct Extent {
  std::vector<TileIndex> squares;  // in Morton order
  TilesetBounds bounds;
  TileIndex first;  // lowest x and y
  std::size_t points = 0;
};

// Leaves one point a voxel in each file.
Result<Extent> thin_squares(const TileFiles& files, double voxel_m) {
  struct Thinned {
    Status status = ok();
    std::size_t points = 0;
    float low_m = 0.f, high_m = 0.f;
  };
  Extent extent;
  extent.squares = files.tiles();
  extent.bounds.voxel_m = voxel_m;
  std::vector<Thinned> each(extent.squares.size());
  tbb::parallel_for(std::size_t{0}, each.size(), [&](std::size_t i) {
    const auto raw = files.take(extent.squares[i]);
    if (!raw) {
      each[i].status = raw.error();
      return;
    }
    const std::vector<MapPoint> points = one_point_a_voxel(*raw, voxel_m);
    const auto [low, high] = std::minmax_element(points.begin(), points.end(),
                                                 [](const MapPoint& a, const MapPoint& b) { return a.z < b.z; });
    each[i] = {files.replace(extent.squares[i], points), points.size(), low->z, high->z};
  });
  for (const Thinned& thinned : each)
    if (!thinned.status) return thinned.status.error();
  if (each.empty()) return extent;
  TileIndex last = extent.first = extent.squares.front();
  Eigen::Vector3d &low = extent.bounds.low, &high = extent.bounds.high;
  low.z() = static_cast<double>(each.front().low_m);
  high.z() = static_cast<double>(each.front().high_m);
  for (std::size_t i = 0; i < each.size(); ++i) {
    const TileIndex& square = extent.squares[i];
    extent.first = {std::min(extent.first.x, square.x), std::min(extent.first.y, square.y)};
    last = {std::max(last.x, square.x), std::max(last.y, square.y)};
    low.z() = std::min(low.z(), static_cast<double>(each[i].low_m));
    high.z() = std::max(high.z(), static_cast<double>(each[i].high_m));
    extent.points += each[i].points;
  }
  const double square_m = TilesetWriter::square_m(voxel_m);
  low.head<2>() = square_m * Eigen::Vector2d(extent.first.x, extent.first.y);
  high.head<2>() = square_m * Eigen::Vector2d(last.x + 1, last.y + 1);
  high.head<2>().array() -= voxel_m;  // inside the last square
  const auto order = [&](const TileIndex& square) {
    return TilesetWriter::order(static_cast<std::uint32_t>(square.x - extent.first.x),
                                static_cast<std::uint32_t>(square.y - extent.first.y));
  };
  std::sort(extent.squares.begin(), extent.squares.end(),
            [&](const TileIndex& a, const TileIndex& b) { return order(a) < order(b); });
  return extent;
}

Eigen::Vector3d centre_of(const TileIndex& square, double square_m) {
  return {(square.x + 0.5) * square_m, (square.y + 0.5) * square_m, 0.0};
}

// The tiles, and the files of the whole map, in one pass over the squares.
Status write_files(const TileFiles& files, const Extent& extent, const MapOptions& options, const fs::path& folder) {
  constexpr std::size_t kAtOnce = 8;
  const double square_m = TilesetWriter::square_m(options.voxel_m);
  TilesetWriter tileset(folder / "tiles", extent.bounds);
  std::vector<CloudFile> maps;
  for (const CloudFormat format : options.formats) {
    const char* const name = format == CloudFormat::kPly   ? "map.ply"
                             : format == CloudFormat::kPcd ? "map.pcd"
                                                           : "map.las";
    maps.emplace_back(folder / name, format, extent.points, options.las_offset_m, options.las_epsg);
  }
  for (std::size_t begin = 0; begin < extent.squares.size(); begin += kAtOnce) {
    std::vector<TilesetWriter::Square> squares;
    for (std::size_t i = begin; i < std::min(begin + kAtOnce, extent.squares.size()); ++i) {
      const TileIndex& index = extent.squares[i];
      auto points = files.take(index);
      if (!points) return points.error();
      const std::vector<Point> plain = without_labels(*points);
      for (std::size_t m = 0; m < maps.size(); ++m) {
        const bool is_moved = options.formats[m] == CloudFormat::kLas && options.T_las_world;
        maps[m].add(is_moved ? placed(plain, {}, options.T_las_world(centre_of(index, square_m))) : plain);
      }
      squares.push_back({static_cast<std::uint32_t>(index.x - extent.first.x),
                         static_cast<std::uint32_t>(index.y - extent.first.y), *std::move(points)});
    }
    if (const Status status = tileset.add(squares); !status) return status;
  }
  for (CloudFile& map : maps)
    if (const Status status = map.finish(); !status) return status;
  return tileset.finish();
}

}  // namespace

Result<std::vector<Point>> collect_map(const MapInput& input, const MapOptions& options,
                                       const std::function<bool(std::size_t)>& progress) {
  std::vector<MapPoint> points;
  std::size_t moving = 0, thin_at = 4'000'000;
  bool is_stopped = false;
  const auto take = [&](const std::vector<Point>& placed, std::size_t done) {
    const std::vector<MapPoint> added = labelled(placed, input, done - 1);
    points.insert(points.end(), added.begin(), added.end());
    // Thinned meanwhile: most of what a key frame sees is in the map already.
    if (points.size() > thin_at) {
      points = one_point_a_voxel(points, options.voxel_m);
      thin_at = std::max(thin_at, 2 * points.size());
    }
    is_stopped = progress && !progress(done);
    return is_stopped ? Next::kStop : Next::kGoOn;
  };
  if (const Status status = for_each_keyframe(input, options, moving, take); !status) return status.error();
  if (is_stopped) return std::vector<Point>{};
  return without_labels(one_point_a_voxel(points, options.voxel_m));
}

Result<MapReport> build_map(const MapInput& input, const MapOptions& options, const fs::path& folder,
                            const std::function<bool(std::size_t)>& progress) {
  const fs::path tiles = folder / "tiles";
  std::error_code failure;
  fs::remove_all(tiles, failure);
  fs::create_directories(tiles, failure);
  if (failure) return Error{tiles.string() + ": cannot be created: " + failure.message()};

  MapReport report;
  TileFiles files(tiles, TilesetWriter::square_m(options.voxel_m));
  Status written = ok();
  bool is_stopped = false;
  const Status visited =
      for_each_keyframe(input, options, report.moving, [&](const std::vector<Point>& placed, std::size_t done) {
        written = files.add(labelled(placed, input, done - 1));
        is_stopped = progress && !progress(done);
        return written && !is_stopped ? Next::kGoOn : Next::kStop;
      });
  if (!visited) return visited.error();
  if (!written) return written.error();
  if (is_stopped) {
    fs::remove_all(tiles, failure);
    return report;
  }
  if (const Status status = files.flush(); !status) return status.error();
  const auto extent = thin_squares(files, options.voxel_m);
  if (!extent) return extent.error();
  report.points = extent->points;
  if (const Status status = write_files(files, *extent, options, folder); !status) return status.error();
  return report;
}

}  // namespace revisit
