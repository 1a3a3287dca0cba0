// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <compare>
#include <cstdint>
#include <filesystem>
#include <span>
#include <unordered_map>
#include <vector>

#include <Eigen/Core>

#include <revisit/core/pose.hpp>
#include <revisit/core/result.hpp>
#include <revisit/core/scan.hpp>

namespace revisit {

/// What a vehicle may drive over, seen from above, as navigation stacks load it. A cell is occupied where something
/// stands between the vehicle's clearance and its height, free where the ground was seen or seen over, and unknown
/// else. Belongs to one thread at a time.
class OccupancyGrid {
 public:
  struct Options {
    double cell_m = 0.1;
    double clearance_m = 0.2, height_m = 2.0;  ///< above the ground: what lies between is in the way
    double range_m = 25.0;                     ///< from a key frame, within which its points count
  };
  explicit OccupancyGrid(const Options& options) : options_(options) {}

  /// A key frame: its points and those of them that lie on the ground, in the frame of its sensor, metres.
  void add(const Pose& T_map_lidar, std::span<const Point> points, std::span<const Eigen::Vector3f> ground);

  enum class Cell : std::uint8_t { kUnknown, kFree, kOccupied };
  /// At a place of the map.
  Cell at(double x_m, double y_m) const;
  struct Image {
    std::size_t width = 0, height = 0;
    double x_m = 0.0, y_m = 0.0;  ///< of the lower left corner
    std::vector<Cell> cells;      ///< row by row, from the lowest y
  };
  /// An error where nothing was added, or where it would be too large.
  Result<Image> image() const;
  double cell_m() const { return options_.cell_m; }
  /// NAME.pgm and NAME.yaml (`image`, `resolution`, `origin` of the lower left corner, ...). An error where nothing was
  /// added, or where a file cannot be written.
  Status write(const std::filesystem::path& yaml_file) const;

 private:
  struct Key {  ///< of a cell
    std::int32_t x = 0, y = 0;
    auto operator<=>(const Key&) const = default;
  };
  struct Hash {
    std::size_t operator()(const Key& key) const {
      return (static_cast<std::size_t>(static_cast<std::uint32_t>(key.x)) * 0x9E3779B97F4A7C15u) ^
             (static_cast<std::size_t>(static_cast<std::uint32_t>(key.y)) * 0xC2B2AE3D27D4EB4Fu);
    }
  };
  struct Seen {
    std::uint32_t through = 0, obstacle = 0;
  };
  Key key(const Eigen::Vector3d& p) const;
  void see_over(const Key& from, const Key& to);
  static Cell verdict(const Seen& seen);

  Options options_;
  std::unordered_map<Key, Seen, Hash> cells_;
};

}  // namespace revisit
