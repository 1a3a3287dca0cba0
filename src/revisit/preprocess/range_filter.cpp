// SPDX-License-Identifier: Apache-2.0
#include <revisit/preprocess/range_filter.hpp>

#include <cmath>
#include <vector>

#include <revisit/core/pose.hpp>

namespace revisit {
namespace {

// Turns each point upwards about the sensor's centre, at its own azimuth.
void raise(std::vector<Point>& points, double offset_deg) {
  const auto c = static_cast<float>(std::cos(to_radians(offset_deg)));
  const auto s = static_cast<float>(std::sin(to_radians(offset_deg)));
  for (Point& p : points) {
    const float across = std::hypot(p.x, p.y);
    if (across == 0.f) continue;
    const float scale = c - s * p.z / across;
    p.z = c * p.z + s * across;
    p.x *= scale;
    p.y *= scale;
  }
}

}  // namespace

void filter_range(Scan& scan, const PreprocessOptions& options) {
  require_consistent(scan);
  const float min2 = static_cast<float>(options.min_range_m * options.min_range_m);
  const float max2 = static_cast<float>(options.max_range_m * options.max_range_m);
  // Written always, advanced only where kept: no branch for the processor to guess.
  Point* points = scan.points.data();
  std::uint16_t* rings = scan.rings.empty() ? nullptr : scan.rings.data();
  float* times = scan.times_s.empty() ? nullptr : scan.times_s.data();
  const std::size_t count = scan.points.size();
  std::size_t kept = 0;
  for (std::size_t i = 0; i < count; ++i) {
    Point p = points[i];
    // A reading that is no number (NaN, infinite) reads as no intensity.
    p.intensity = std::isfinite(p.intensity) ? p.intensity : 0.f;
    const float range2 = p.x * p.x + p.y * p.y + p.z * p.z;
    points[kept] = p;
    if (rings != nullptr) rings[kept] = rings[i];
    if (times != nullptr) times[kept] = times[i];
    kept += static_cast<std::size_t>((range2 > 0.f) & (range2 >= min2) & (range2 <= max2));
  }
  scan.points.resize(kept);
  if (options.elevation_offset_deg != 0.0) raise(scan.points, options.elevation_offset_deg);
  if (rings != nullptr) scan.rings.resize(kept);
  if (times != nullptr) scan.times_s.resize(kept);
}

}  // namespace revisit
