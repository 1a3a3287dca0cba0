// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include <revisit/core/ids.hpp>
#include <revisit/core/imu.hpp>

namespace revisit {

/// One LiDAR return: position in metres in the LiDAR frame (x forward, y left, z up), and intensity,
/// in the sensor's own unit as read and in [0, 1] after normalisation.
struct Point {
  float x = 0.f, y = 0.f, z = 0.f, intensity = 0.f;

  void archive(auto& fields) { fields(x, y, z, intensity); }
};
static_assert(sizeof(Point) == 16, "the point loops read four floats at a time");

/// Height of the ground where it is not known, in the frame of the sensor: one on the roof of a car (KITTI's).
constexpr double kGroundBelowCarSensor_m = -1.73;

/// One sweep of a LiDAR. `rings` and `times_s` are empty or hold one entry a point.
struct Scan {
  FrameId frame;
  double stamp_s = 0.0;                ///< time of the scan, seconds, any epoch
  std::vector<Point> points;           ///< finite, never (0,0,0): readers drop and count those
  std::vector<std::uint16_t> rings;    ///< laser ring of each point, any numbering
  std::vector<float> times_s;          ///< time of each point from `stamp_s`, seconds; may be negative
  std::size_t dropped_non_finite = 0;  ///< points left out by the reader: NaN or infinite
  std::size_t dropped_at_origin = 0;   ///< points left out by the reader: exactly (0,0,0), "no return"
  std::vector<ImuSample> imu = {};     ///< from before the sweep to its end, increasing times; may be empty
  /// Which way is up, a unit vector in the frame of the points, where something knows it (a mounting, gravity).
  std::optional<Eigen::Vector3f> up = std::nullopt;
  bool is_stamp_assumed = false;  ///< no time is known: `stamp_s` counts 0.1 s a frame

  void archive(auto& fields) {
    fields(frame, stamp_s, points, rings, times_s, dropped_non_finite, dropped_at_origin, imu, up, is_stamp_assumed);
    const auto fits = [&](std::size_t size) { return size == 0 || size == points.size(); };
    fields.require(fits(rings.size()) && fits(times_s.size()));
  }
};

/// Throws std::invalid_argument unless `rings` and `times_s` are empty or hold one entry a point.
inline void require_consistent(const Scan& scan) {
  const auto fits = [&](std::size_t size) { return size == 0 || size == scan.points.size(); };
  if (!fits(scan.rings.size()) || !fits(scan.times_s.size()))
    throw std::invalid_argument("a scan of " + std::to_string(scan.points.size()) + " points with " +
                                std::to_string(scan.rings.size()) + " rings and " +
                                std::to_string(scan.times_s.size()) + " times; allowed: none, or one a point");
}

/// Keeps the points whose index satisfies `keep`, with their rings and times, in their order.
template <typename Predicate>
void keep_points(Scan& scan, Predicate keep) {
  require_consistent(scan);
  std::size_t kept = 0;
  for (std::size_t i = 0; i < scan.points.size(); ++i) {
    if (!keep(i)) continue;
    scan.points[kept] = scan.points[i];
    if (!scan.rings.empty()) scan.rings[kept] = scan.rings[i];
    if (!scan.times_s.empty()) scan.times_s[kept] = scan.times_s[i];
    ++kept;
  }
  scan.points.resize(kept);
  if (!scan.rings.empty()) scan.rings.resize(kept);
  if (!scan.times_s.empty()) scan.times_s.resize(kept);
}

}  // namespace revisit
