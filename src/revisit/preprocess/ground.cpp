// SPDX-License-Identifier: Apache-2.0
#include <revisit/preprocess/ground.hpp>

#include <algorithm>
#include <cmath>

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>

#include <revisit/core/pose.hpp>
#include <revisit/preprocess/internal/polar_ground.hpp>
#include <revisit/preprocess/internal/range_image.hpp>

namespace revisit {
namespace {

using preprocess_internal::RangeImage;

// LeGO-LOAM's vertical test: the line between two returns of neighbouring rings rises at most by the slope. Only
// returns from below the sensor can be on the ground.
std::vector<std::uint8_t> label_pixels(const RangeImage& image, double slope_deg) {
  const float tan2 = static_cast<float>(std::pow(std::tan(to_radians(slope_deg)), 2));
  std::vector<std::uint8_t> labels(image.pixels.size(), 0);
  const auto is_level = [&](const RangeImage::Pixel& p, const RangeImage::Pixel& q) {
    const float dx = p.x - q.x, dy = p.y - q.y, dz = p.z - q.z;
    return dz * dz <= tan2 * (dx * dx + dy * dy);
  };
  // A column knows nothing of the others.
  constexpr std::size_t kColumnsATask = 256;
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, image.columns, kColumnsATask), [&](const auto& columns) {
    for (std::size_t row = 0; row + 1 < image.rows; ++row) {
      for (std::size_t column = columns.begin(); column < columns.end(); ++column) {
        const std::size_t lower = row * image.columns + column;
        const RangeImage::Pixel& p = image.pixels[lower];
        if (p.is_empty() || p.z >= 0.f) continue;
        // A single lost return must not end the ground: one missing row is bridged.
        for (std::size_t step = 1; step <= 2 && row + step < image.rows; ++step) {
          const std::size_t upper = lower + step * image.columns;
          if (image.pixels[upper].is_empty()) continue;
          if (is_level(p, image.pixels[upper])) labels[lower] = labels[upper] = 1;
          break;
        }
      }
    }
  });
  return labels;
}

// Ground is large: patches of few pixels (car roofs, bonnets, ledges) lose their label. Neighbours belong together
// unless a step in height parts them.
void remove_small_segments(const RangeImage& image, int fewest, std::vector<std::uint8_t>& labels) {
  constexpr float kStep_m = 0.3f;
  constexpr std::uint8_t kGround = 1, kDone = 2;
  struct At {
    std::uint32_t pixel, column;
  };
  const auto columns = static_cast<std::uint32_t>(image.columns), count = static_cast<std::uint32_t>(labels.size());
  std::vector<At> segment;
  segment.reserve(labels.size());
  const auto take = [&](At at) {
    labels[at.pixel] = kDone;
    segment.push_back(at);
  };
  for (std::uint32_t row = 0; row < count; row += columns)
    for (std::uint32_t column = 0; column < columns; ++column) {
      if (labels[row + column] != kGround) continue;
      segment.clear();
      take({row + column, column});
      for (std::size_t next = 0; next < segment.size(); ++next) {
        const auto [pixel, at] = segment[next];
        const auto take_if_level = [&, from = pixel](At to) {
          if (labels[to.pixel] == kGround && std::abs(image.pixels[to.pixel].z - image.pixels[from].z) <= kStep_m)
            take(to);
        };
        if (pixel >= columns) take_if_level({pixel - columns, at});
        if (pixel + columns < count) take_if_level({pixel + columns, at});
        take_if_level(at > 0 ? At{pixel - 1, at - 1} : At{pixel + columns - 1, columns - 1});
        take_if_level(at + 1 < columns ? At{pixel + 1, at + 1} : At{pixel + 1 - columns, 0});
      }
      if (segment.size() < static_cast<std::size_t>(fewest))
        for (const At& each : segment) labels[each.pixel] = 0;
    }
}

// Points that share a pixel with a ground point are ground if they are no higher than its roughness.
std::vector<std::uint8_t> label_points(const Scan& scan, const RangeImage& image,
                                       const std::vector<std::uint8_t>& labels) {
  std::vector<std::uint8_t> is_ground(scan.points.size(), 0);
  for (std::size_t i = 0; i < scan.points.size(); ++i) {
    const auto pixel = static_cast<std::size_t>(image.pixel_of[i]);
    if (labels[pixel] == 0) continue;
    is_ground[i] = scan.points[i].z - image.pixels[pixel].z < GroundConstants::kThickness_m;
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
  std::vector<std::uint8_t> labels = label_pixels(image, GroundConstants::kSlope_deg);
  remove_small_segments(image, GroundConstants::kFewestPixels, labels);
  result.is_ground = label_points(scan, image, labels);
  return result;
}

double ground_height_m(std::span<const Point> points, std::span<const std::uint8_t> is_ground) {
  constexpr float kNearby2 = GroundConstants::kNearby_m * GroundConstants::kNearby_m;
  std::vector<float> heights;
  for (std::size_t i = 0; i < points.size(); ++i)
    if (is_ground[i] != 0 && points[i].x * points[i].x + points[i].y * points[i].y < kNearby2)
      heights.push_back(points[i].z);
  if (heights.size() < GroundConstants::kFewestNearby) return kGroundBelowCarSensor_m;
  const auto middle = heights.begin() + static_cast<std::ptrdiff_t>(heights.size() / 2);
  std::nth_element(heights.begin(), middle, heights.end());
  return static_cast<double>(*middle);
}

std::vector<Point> above_ground(std::span<const Point> points, std::span<const std::uint8_t> is_ground) {
  std::vector<Point> above;
  above.reserve(points.size());
  for (std::size_t i = 0; i < points.size(); ++i)
    if (is_ground[i] == 0) above.push_back(points[i]);
  return above;
}

}  // namespace revisit
