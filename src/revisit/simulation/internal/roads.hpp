// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include <revisit/simulation/internal/path.hpp>
#include <revisit/simulation/internal/terrain.hpp>

namespace revisit::simulation_internal {

/// The middle of a driven lane.
struct LanePoint {
  float x, y, cos_yaw, sin_yaw, arc_m;
};

/// Which lane is nearest to a place on the ground; built once, then used for each beam that meets the ground.
class Roads {
 public:
  /// Sides of the road seen from the middle of its right lane, metres to the left.
  static constexpr float kRightEdge_m = -3.8f, kLeftEdge_m = 5.9f, kCentreLine_m = 1.45f, kPavement_m = 1.6f;

  Roads() = default;
  Roads(const std::vector<std::vector<Knot>>& lanes, const Terrain& grid);

  struct Place {
    float left_m, arc_m;
  };
  std::optional<Place> nearest(float x, float y) const;
  const std::vector<LanePoint>& points() const { return points_; }

 private:
  std::vector<LanePoint> points_;
  float x_min_ = 0.f, y_min_ = 0.f;
  int columns_ = 0, rows_ = 0;
  std::vector<std::uint32_t> first_;  ///< of each cell in `near_`
  std::vector<LanePoint> near_;       ///< the points that can be nearest to a place in the cell
};

}  // namespace revisit::simulation_internal
