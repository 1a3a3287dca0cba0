// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include <revisit/core/fast_math.hpp>
#include <revisit/core/pose.hpp>
#include <revisit/preprocess/internal/range_image.hpp>

namespace revisit::preprocess_internal {

RangeImage make_range_image(const Scan& scan, const Rings& rings) {
  RangeImage image;
  image.rows = rings.count();
  // As many columns as the fullest ring has returns: neighbours in azimuth are neighbours in the image.
  std::vector<std::size_t> ring_sizes(image.rows, 0);
  for (const std::uint16_t ring : rings.of_point) ++ring_sizes[ring];
  const std::size_t fullest = image.rows == 0 ? 0 : *std::max_element(ring_sizes.begin(), ring_sizes.end());
  image.columns = std::clamp<std::size_t>(fullest, 90, 2048);
  image.pixels.resize(image.rows * image.columns);
  image.pixel_of.resize(scan.points.size());
  // Columns first, in a loop that becomes SIMD; then the scatter.
  const auto columns_per_rad = static_cast<float>(static_cast<double>(image.columns) / (2.0 * kPi));
  const auto last_column = static_cast<std::int32_t>(image.columns) - 1;
  for (std::size_t i = 0; i < scan.points.size(); ++i) {
    const float turned = approximate_atan2(scan.points[i].y, scan.points[i].x) + static_cast<float>(kPi);
    const auto column = static_cast<std::int32_t>(turned * columns_per_rad);
    image.pixel_of[i] = column < last_column ? column : last_column;
  }
  for (std::size_t i = 0; i < scan.points.size(); ++i) {
    image.pixel_of[i] += static_cast<std::int32_t>(rings.of_point[i] * image.columns);
    RangeImage::Pixel& pixel = image.pixels[static_cast<std::size_t>(image.pixel_of[i])];
    const Point& p = scan.points[i];
    const float range2 = p.x * p.x + p.y * p.y + p.z * p.z;
    if (range2 < pixel.squared_range_m2) pixel = {p.x, p.y, p.z, range2};
  }
  return image;
}

}  // namespace revisit::preprocess_internal
