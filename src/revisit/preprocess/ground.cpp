// SPDX-License-Identifier: Apache-2.0
#include <revisit/preprocess/ground.hpp>

#include <array>
#include <cmath>

#include <revisit/core/pose.hpp>
#include <revisit/preprocess/internal/polar_ground.hpp>
#include <revisit/preprocess/internal/range_image.hpp>

namespace revisit {
namespace {

using preprocess_internal::RangeImage;

// LeGO-LOAM's vertical test: the line between two returns of neighbouring rings rises at most by the slope. Only
// returns from below the sensor can be on the ground.
std::vector<std::uint8_t> label_pixels(const Scan& scan, const RangeImage& image, double slope_deg) {
  const float tan2 = static_cast<float>(std::pow(std::tan(to_radians(slope_deg)), 2));
  std::vector<std::uint8_t> labels(image.point_at.size(), 0);
  const auto is_level = [&](std::int32_t a, std::int32_t b) {
    const Point& p = scan.points[static_cast<std::size_t>(a)];
    const Point& q = scan.points[static_cast<std::size_t>(b)];
    const float dx = p.x - q.x, dy = p.y - q.y, dz = p.z - q.z;
    return dz * dz <= tan2 * (dx * dx + dy * dy);
  };
  for (std::size_t row = 0; row + 1 < image.rows; ++row) {
    for (std::size_t column = 0; column < image.columns; ++column) {
      const std::size_t lower = row * image.columns + column;
      const std::int32_t a = image.point_at[lower];
      if (a == RangeImage::kEmpty || scan.points[static_cast<std::size_t>(a)].z >= 0.f) continue;
      // A single lost return must not end the ground: one missing row is bridged.
      for (std::size_t step = 1; step <= 2 && row + step < image.rows; ++step) {
        const std::size_t upper = lower + step * image.columns;
        const std::int32_t b = image.point_at[upper];
        if (b == RangeImage::kEmpty) continue;
        if (is_level(a, b)) labels[lower] = labels[upper] = 1;
        break;
      }
    }
  }
  return labels;
}

// Ground is large: patches of few pixels (car roofs, bonnets, ledges) lose their label. Neighbours belong together
// unless a step in height parts them.
void remove_small_segments(const Scan& scan, const RangeImage& image, int fewest, std::vector<std::uint8_t>& labels) {
  constexpr float kStep_m = 0.3f;
  constexpr std::uint8_t kGround = 1, kDone = 2;
  const auto rows = static_cast<std::int32_t>(image.rows), columns = static_cast<std::int32_t>(image.columns);
  const auto height = [&](std::int32_t pixel) {
    return scan.points[static_cast<std::size_t>(image.point_at[static_cast<std::size_t>(pixel)])].z;
  };
  std::vector<std::int32_t> segment;
  segment.reserve(labels.size());
  for (std::int32_t seed = 0; seed < rows * columns; ++seed) {
    if (labels[static_cast<std::size_t>(seed)] != kGround) continue;
    segment.assign(1, seed);
    labels[static_cast<std::size_t>(seed)] = kDone;
    for (std::size_t next = 0; next < segment.size(); ++next) {
      const std::int32_t pixel = segment[next], row = pixel / columns, column = pixel % columns;
      const std::array<std::int32_t, 4> neighbours = {
          row > 0 ? pixel - columns : -1, row + 1 < rows ? pixel + columns : -1,
          column > 0 ? pixel - 1 : pixel + columns - 1, column + 1 < columns ? pixel + 1 : pixel - columns + 1};
      for (const std::int32_t neighbour : neighbours) {
        if (neighbour < 0 || labels[static_cast<std::size_t>(neighbour)] != kGround) continue;
        if (std::abs(height(neighbour) - height(pixel)) > kStep_m) continue;
        labels[static_cast<std::size_t>(neighbour)] = kDone;
        segment.push_back(neighbour);
      }
    }
    if (segment.size() < static_cast<std::size_t>(fewest))
      for (const std::int32_t pixel : segment) labels[static_cast<std::size_t>(pixel)] = 0;
  }
}

// Points that share a pixel with a ground point are ground if they are no higher than its roughness.
std::vector<std::uint8_t> label_points(const Scan& scan, const RangeImage& image,
                                       const std::vector<std::uint8_t>& labels) {
  constexpr float kThickness_m = 0.15f;
  std::vector<std::uint8_t> is_ground(scan.points.size(), 0);
  for (std::size_t i = 0; i < scan.points.size(); ++i) {
    const auto pixel = static_cast<std::size_t>(image.pixel_of[i]);
    if (labels[pixel] == 0) continue;
    const auto nearest = static_cast<std::size_t>(image.point_at[pixel]);
    is_ground[i] = scan.points[i].z - scan.points[nearest].z < kThickness_m;
  }
  return is_ground;
}

}  // namespace

GroundSegmentation segment_ground(const Scan& scan, const Rings& rings, const PreprocessOptions& options) {
  GroundSegmentation result;
  result.rings = rings.source;
  result.ring_count = rings.count();
  if (rings.source == RingSource::kNone) {
    result.is_ground = preprocess_internal::polar_ground(scan, options);
    return result;
  }
  const RangeImage image = preprocess_internal::make_range_image(scan, rings);
  std::vector<std::uint8_t> labels = label_pixels(scan, image, options.ground_slope_deg);
  remove_small_segments(scan, image, options.ground_min_segment_points, labels);
  result.is_ground = label_points(scan, image, labels);
  return result;
}

}  // namespace revisit
