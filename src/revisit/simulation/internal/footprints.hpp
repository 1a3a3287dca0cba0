// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <unordered_map>

#include <revisit/simulation/internal/random.hpp>

namespace revisit::simulation_internal {

/// Which ground is taken, in cells of a quarter of a metre, so that nothing is built on a road or into something else.
class Footprints {
 public:
  struct Rectangle {
    double x, y, yaw_rad, half_length_m, half_width_m;
  };

  void take(const Rectangle& r) {
    visit(r, [&](std::uint8_t& cell) { return cell = 1, true; });
  }
  bool is_free(const Rectangle& r) {
    return visit(r, [](const std::uint8_t& cell) { return cell == 0; });
  }
  /// Takes the rectangle if all of it is free.
  bool take_if_free(const Rectangle& r) {
    if (!is_free(r)) return false;
    take(r);
    return true;
  }

 private:
  static constexpr double kCell_m = 0.25;
  static constexpr int kTile = 64;  // cells a side
  using Tile = std::array<std::uint8_t, static_cast<std::size_t>(kTile* kTile)>;

  template <typename Visitor>
  bool visit(const Rectangle& r, Visitor visitor) {
    const double c = std::cos(r.yaw_rad), s = std::sin(r.yaw_rad), step = 0.8 * kCell_m;
    const int along = static_cast<int>(r.half_length_m / step) + 1,
              across = static_cast<int>(r.half_width_m / step) + 1;
    for (int i = -along; i <= along; ++i)
      for (int j = -across; j <= across; ++j) {
        const double u = r.half_length_m * i / along, v = r.half_width_m * j / across;
        if (!visitor(cell(r.x + c * u - s * v, r.y + s * u + c * v))) return false;
      }
    return true;
  }

  std::uint8_t& cell(double x, double y) {
    const int column = floor_int(x / kCell_m), row = floor_int(y / kCell_m);
    const int tile_x = floor_int(static_cast<double>(column) / kTile),
              tile_y = floor_int(static_cast<double>(row) / kTile);
    const auto key =
        (static_cast<std::uint64_t>(static_cast<std::uint32_t>(tile_x)) << 32) | static_cast<std::uint32_t>(tile_y);
    auto found = tiles_.find(key);
    if (found == tiles_.end()) found = tiles_.emplace(key, Tile{}).first;
    return found->second[static_cast<std::size_t>((row - kTile * tile_y) * kTile + column - kTile * tile_x)];
  }

  std::unordered_map<std::uint64_t, Tile> tiles_;
};

}  // namespace revisit::simulation_internal
