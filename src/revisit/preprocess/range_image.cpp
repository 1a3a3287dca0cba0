// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include <revisit/core/pose.hpp>
#include <revisit/preprocess/internal/range_image.hpp>

namespace revisit::preprocess_internal {

float approximate_atan2(float y, float x) {
  const float ax = std::abs(x), ay = std::abs(y);
  const float a = std::min(ax, ay) / (std::max(ax, ay) + 1e-30f);
  // Abramowitz and Stegun 4.4.47: atan on [0, 1], error at most 1e-5 rad.
  const float s = a * a;
  float r = a * (0.9998660f + s * (-0.3302995f + s * (0.1801410f + s * (-0.0851330f + s * 0.0208351f))));
  const auto pi = static_cast<float>(kPi);
  r = ay > ax ? pi / 2 - r : r;
  r = x < 0.f ? pi - r : r;
  return y < 0.f ? -r : r;
}

RangeImage make_range_image(const Scan& scan, const Rings& rings) {
  RangeImage image;
  image.rows = rings.count();
  // As many columns as the fullest ring has returns: neighbours in azimuth are neighbours in the image.
  std::vector<std::size_t> ring_sizes(image.rows, 0);
  for (const std::uint16_t ring : rings.of_point) ++ring_sizes[ring];
  const std::size_t fullest = image.rows == 0 ? 0 : *std::max_element(ring_sizes.begin(), ring_sizes.end());
  image.columns = std::clamp<std::size_t>(fullest, 90, 2048);
  image.point_at.assign(image.rows * image.columns, RangeImage::kEmpty);
  image.pixel_of.resize(scan.points.size());
  const float columns_per_rad = static_cast<float>(static_cast<double>(image.columns) / (2.0 * kPi));
  const auto range2 = [&](std::int32_t i) {
    const Point& p = scan.points[static_cast<std::size_t>(i)];
    return p.x * p.x + p.y * p.y + p.z * p.z;
  };
  for (std::size_t i = 0; i < scan.points.size(); ++i) {
    const Point& p = scan.points[i];
    const float angle = approximate_atan2(p.y, p.x) + static_cast<float>(kPi);
    const std::size_t column = static_cast<std::size_t>(std::max(0.f, angle * columns_per_rad)) % image.columns;
    const std::size_t pixel = rings.of_point[i] * image.columns + column;
    image.pixel_of[i] = static_cast<std::int32_t>(pixel);
    std::int32_t& slot = image.point_at[pixel];
    const auto index = static_cast<std::int32_t>(i);
    if (slot == RangeImage::kEmpty || range2(index) < range2(slot)) slot = index;
  }
  return image;
}

}  // namespace revisit::preprocess_internal
