// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <revisit/config/parameters.hpp>
#include <revisit/core/scan.hpp>
#include <revisit/preprocess/rings.hpp>

namespace revisit {

/// Of LeGO-LOAM's vertical test and of what follows it.
struct GroundConstants {
  static constexpr double kSlope_deg = 10.0;    ///< steepest between vertical neighbours (Shan and Englot, IROS 2018)
  static constexpr int kFewestPixels = 30;      ///< smaller flat patches (car roofs) are not ground
  static constexpr float kThickness_m = 0.15f;  ///< roughness of the ground
  static constexpr float kNearby_m = 15.f;      ///< its height below the sensor is taken from so far around
  static constexpr std::size_t kFewestNearby = 50;  ///< points; with fewer, a sensor on the roof of a car is assumed
};

/// Which points lie on the ground, and how that was found.
struct GroundSegmentation {
  std::vector<std::uint8_t> is_ground;   ///< one a point, 0 or 1
  RingSource rings = RingSource::kNone;  ///< kNone: the polar-grid fallback, for sensors without rings
  std::size_t ring_count = 0;
};

/// Ground as in LeGO-LOAM (paper, section III-A): in the range image (row = ring, column = azimuth), two vertically
/// neighbouring returns are ground where the slope between them is small; small patches are not ground. Sensors without
/// rings fall back to a polar grid of lowest points, walked outward with the same slope. Assumes that z points up
/// within the slope. `rings` come from find_rings(scan).
GroundSegmentation segment_ground(const Scan& scan, const Rings& rings, const PreprocessOptions& options);

/// Height of the ground around the sensor, metres in the sensor's frame (negative): the median of ground points nearby.
double ground_height_m(std::span<const Point> points, std::span<const std::uint8_t> is_ground);
/// The points that are not on the ground, in their order.
std::vector<Point> above_ground(std::span<const Point> points, std::span<const std::uint8_t> is_ground);

}  // namespace revisit
