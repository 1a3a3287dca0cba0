// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <limits>

#include <revisit/core/fast_math.hpp>
#include <revisit/core/pose.hpp>
#include <revisit/preprocess/ground.hpp>
#include <revisit/preprocess/internal/polar_ground.hpp>

namespace revisit::preprocess_internal {
namespace {

constexpr std::size_t kSectors = 180;
constexpr float kCell_m = 1.5f;
constexpr float kThickness_m = 0.25f;  // roughness and noise of what is still the same ground

}  // namespace

std::vector<std::uint8_t> polar_ground(const Scan& scan, const PreprocessOptions& options) {
  constexpr float kUnknown = std::numeric_limits<float>::infinity();
  const auto cells = static_cast<std::size_t>(std::ceil(options.max_range_m / kCell_m));
  std::vector<float> lowest(kSectors * cells, kUnknown);
  std::vector<std::size_t> cell_of(scan.points.size());
  std::vector<float> heights;
  heights.reserve(scan.points.size());
  for (std::size_t i = 0; i < scan.points.size(); ++i) {
    const Point& p = scan.points[i];
    const auto ring = std::min(static_cast<std::size_t>(std::hypot(p.x, p.y) / kCell_m), cells - 1);
    const float turn = (approximate_atan2(p.y, p.x) + static_cast<float>(kPi)) / static_cast<float>(2 * kPi);
    const auto sector = static_cast<std::size_t>(std::max(0.f, turn * kSectors)) % kSectors;
    cell_of[i] = sector * cells + ring;
    lowest[cell_of[i]] = std::min(lowest[cell_of[i]], p.z);
    heights.push_back(p.z);
  }
  if (heights.empty()) return {};
  // Where a sector starts: nothing that is low for the whole scan can be far above its tenth percentile.
  auto tenth = heights.begin() + static_cast<std::ptrdiff_t>(heights.size() / 10);
  std::nth_element(heights.begin(), tenth, heights.end());
  const float start_height = *tenth;
  const float steepest = static_cast<float>(std::tan(to_radians(GroundConstants::kSlope_deg)));
  std::vector<float> ground(kSectors * cells, -kUnknown);
  for (std::size_t sector = 0; sector < kSectors; ++sector) {
    float height = start_height;
    float distance = 0.f;  // since the last cell whose ground was seen
    for (std::size_t ring = 0; ring < cells; ++ring) {
      distance += kCell_m;
      const float here = lowest[sector * cells + ring];
      if (here == kUnknown || std::abs(here - height) > kThickness_m + steepest * distance) continue;
      ground[sector * cells + ring] = height = here;
      distance = 0.f;
    }
  }
  std::vector<std::uint8_t> is_ground(scan.points.size(), 0);
  for (std::size_t i = 0; i < scan.points.size(); ++i)
    is_ground[i] = scan.points[i].z - ground[cell_of[i]] < kThickness_m;
  return is_ground;
}

}  // namespace revisit::preprocess_internal
