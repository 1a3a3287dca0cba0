// SPDX-License-Identifier: Apache-2.0
#include <revisit/mapping/internal/moving_points.hpp>

#include <algorithm>
#include <cmath>

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>

namespace revisit::mapping_internal {
namespace {

// Margins from what poses and grazing angles bring at 30 m (docs/slam.md).
struct Moving {
  static constexpr float kMargin_m = 0.5f, kMarginShare = 0.02f;  ///< of the range
  static constexpr int kFewest = 2;                               ///< observers that saw through a point
};

constexpr int kAzimuths = 360, kElevations = 90;
constexpr auto kCellsARad = static_cast<float>(kAzimuths / (2.0 * kPi));

struct Cell {
  int azimuth = 0, elevation = 0;
  bool is_inside() const { return elevation >= 0 && elevation < kElevations; }
};

Cell cell_of(float x, float y, float z) {
  const float elevation = std::atan2(z, std::sqrt(x * x + y * y)) * kCellsARad + kElevations / 2.f;
  const float azimuth = (std::atan2(y, x) + static_cast<float>(kPi)) * kCellsARad;
  return {static_cast<int>(azimuth) % kAzimuths, static_cast<int>(std::floor(elevation))};
}

std::size_t index_of(int azimuth, int elevation) {
  return static_cast<std::size_t>((azimuth + kAzimuths) % kAzimuths) * kElevations +
         static_cast<std::size_t>(elevation);
}

}  // namespace

VisibilityImage::VisibilityImage(std::span<const Point> points) : ranges_m_(std::size_t{kAzimuths} * kElevations) {
  std::vector<float> nearest_m(ranges_m_.size());
  for (const Point& p : points) {
    const Cell cell = cell_of(p.x, p.y, p.z);
    if (!cell.is_inside()) continue;
    float& nearest = nearest_m[index_of(cell.azimuth, cell.elevation)];
    const float range_m = std::sqrt(p.x * p.x + p.y * p.y + p.z * p.z);
    if (nearest == 0.f || range_m < nearest) nearest = range_m;
  }
  // Poses are off by decimetres, and ground far away is seen at a grazing angle: the nearest around a cell counts.
  for (int azimuth = 0; azimuth < kAzimuths; ++azimuth)
    for (int elevation = 0; elevation < kElevations; ++elevation) {
      float& least = ranges_m_[index_of(azimuth, elevation)];
      least = nearest_m[index_of(azimuth, elevation)];
      if (least == 0.f) continue;
      for (int a = azimuth - 1; a <= azimuth + 1; ++a)
        for (int e = std::max(0, elevation - 1); e <= std::min(kElevations - 1, elevation + 1); ++e)
          if (const float range_m = nearest_m[index_of(a, e)]; range_m > 0.f) least = std::min(least, range_m);
    }
}

VisibilityImage::Verdict VisibilityImage::look(const Eigen::Vector3f& p) const {
  const Cell cell = cell_of(p.x(), p.y(), p.z());
  const float nearest_m = cell.is_inside() ? ranges_m_[index_of(cell.azimuth, cell.elevation)] : 0.f;
  if (nearest_m == 0.f) return Verdict::kUnknown;
  const float range_m = p.norm(), margin_m = Moving::kMargin_m + Moving::kMarginShare * range_m;
  if (nearest_m > range_m + margin_m) return Verdict::kThrough;
  return nearest_m > range_m - margin_m ? Verdict::kSurface : Verdict::kUnknown;
}

std::vector<std::uint8_t> find_moving(std::span<const Point> points, const Pose& T_world_lidar,
                                      std::span<const Observer> observers) {
  std::vector<Eigen::Isometry3f> T_observer_lidar;
  for (const Observer& each : observers)
    T_observer_lidar.emplace_back((each.T_world_lidar.inverse() * T_world_lidar).cast<float>());
  std::vector<std::uint8_t> is_moving(points.size());
  const auto judge = [&](const Point& p) {
    int through = 0, surface = 0;
    for (std::size_t i = 0; i < observers.size(); ++i) {
      const auto verdict = observers[i].image->look(T_observer_lidar[i] * Eigen::Vector3f(p.x, p.y, p.z));
      through += verdict == VisibilityImage::Verdict::kThrough;
      surface += verdict == VisibilityImage::Verdict::kSurface;
    }
    return through >= Moving::kFewest && through > surface;
  };
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, points.size(), 1024), [&](const auto& range) {
    for (std::size_t i = range.begin(); i != range.end(); ++i) is_moving[i] = judge(points[i]) ? 1 : 0;
  });
  return is_moving;
}

}  // namespace revisit::mapping_internal
