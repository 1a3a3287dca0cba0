// SPDX-License-Identifier: Apache-2.0
#include <revisit/mapping/build_map.hpp>

#include <algorithm>
#include <array>
#include <deque>
#include <optional>
#include <sstream>

#include <revisit/mapping/cloud_file.hpp>
#include <revisit/mapping/internal/moving_points.hpp>
#include <revisit/mapping/internal/tile_files.hpp>

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

Result<MapTile> write_tile(TileFiles& files, const TileIndex& index, const MapOptions& options, const fs::path& tiles) {
  const auto raw = files.take(index);
  if (!raw) return raw.error();
  const std::vector<Point> points = one_point_a_voxel(*raw, options.voxel_m);
  MapTile tile;
  tile.x = index.x;
  tile.y = index.y;
  tile.file = "tile_" + std::to_string(index.x) + "_" + std::to_string(index.y) + ".ply";
  tile.points = points.size();
  const auto [low, high] =
      std::minmax_element(points.begin(), points.end(), [](const Point& a, const Point& b) { return a.z < b.z; });
  tile.min_z_m = static_cast<double>(low->z);
  tile.max_z_m = static_cast<double>(high->z);
  CloudFile file(tiles / tile.file, CloudFormat::kPly, points.size());
  file.add(points);
  if (const Status status = file.finish(); !status) return status.error();
  return tile;
}

// The points stand at the end of the tile's file.
Status append_tile(const fs::path& tile_file, std::size_t count, std::vector<CloudFile>& maps) {
  std::ifstream stream(tile_file, std::ios::binary);
  std::vector<Point> points(count);
  const auto bytes = static_cast<std::streamoff>(count * sizeof(Point));
  stream.seekg(-bytes, std::ios::end);
  stream.read(reinterpret_cast<char*>(points.data()), bytes);
  if (!stream) return Error{tile_file.string() + ": cannot be read back"};
  for (CloudFile& map : maps) map.add(points);
  return ok();
}

Status write_index(const fs::path& file, const MapReport& report, const MapOptions& options) {
  std::ostringstream text;
  text << "{\n  \"tile_m\": " << options.tile_m << ",\n  \"voxel_m\": " << options.voxel_m << ",\n  \"tiles\": [";
  for (std::size_t i = 0; i < report.tiles.size(); ++i) {
    const MapTile& tile = report.tiles[i];
    text << (i == 0 ? "\n" : ",\n") << "    {\"file\": \"" << tile.file << "\", \"x\": " << tile.x
         << ", \"y\": " << tile.y << ", \"points\": " << tile.points << ", \"min_z_m\": " << tile.min_z_m
         << ", \"max_z_m\": " << tile.max_z_m << "}";
  }
  text << "\n  ]\n}\n";
  std::ofstream stream(file);
  stream << text.str();
  stream.close();
  return stream ? ok() : Status(Error{file.string() + ": cannot be written"});
}

}  // namespace

Result<std::vector<Point>> collect_map(const MapInput& input, const MapOptions& options,
                                       const std::function<bool(std::size_t)>& progress) {
  std::vector<Point> points;
  std::size_t moving = 0, thin_at = 4'000'000;
  bool is_stopped = false;
  const auto take = [&](const std::vector<Point>& placed, std::size_t done) {
    points.insert(points.end(), placed.begin(), placed.end());
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
  return one_point_a_voxel(points, options.voxel_m);
}

Result<MapReport> build_map(const MapInput& input, const MapOptions& options, const fs::path& folder,
                            const std::function<bool(std::size_t)>& progress) {
  const fs::path tiles = folder / "tiles";
  std::error_code failure;
  fs::remove_all(tiles, failure);
  fs::create_directories(tiles, failure);
  if (failure) return Error{tiles.string() + ": cannot be created: " + failure.message()};

  MapReport report;
  TileFiles files(tiles, options.tile_m);
  Status written = ok();
  bool is_stopped = false;
  const Status visited =
      for_each_keyframe(input, options, report.moving, [&](const std::vector<Point>& placed, std::size_t done) {
        written = files.add(placed);
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
  for (const TileIndex& index : files.tiles()) {
    auto tile = write_tile(files, index, options, tiles);
    if (!tile) return tile.error();
    report.points += tile->points;
    report.tiles.push_back(*std::move(tile));
  }
  std::vector<CloudFile> maps;
  for (const CloudFormat format : options.formats) {
    const char* const name = format == CloudFormat::kPly   ? "map.ply"
                             : format == CloudFormat::kPcd ? "map.pcd"
                                                           : "map.las";
    maps.emplace_back(folder / name, format, report.points, options.las_offset_m);
  }
  for (const MapTile& tile : report.tiles)
    if (const Status status = append_tile(tiles / tile.file, tile.points, maps); !status) return status.error();
  for (CloudFile& map : maps)
    if (const Status status = map.finish(); !status) return status.error();
  if (const Status status = write_index(tiles / "tiles.json", report, options); !status) return status.error();
  return report;
}

}  // namespace revisit
