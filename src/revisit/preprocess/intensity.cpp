// SPDX-License-Identifier: Apache-2.0
#include <revisit/preprocess/intensity.hpp>

#include <algorithm>
#include <array>
#include <cmath>

namespace revisit {
namespace {

// Odometry front ends store ring + time in the field: whole parts of few values, fractions no longer than a sweep, and
// nearly every reading different. Reflectance repeats itself, or is spread over the whole range between whole numbers.
constexpr double kShareOfDistinctReadings = 0.5, kShareOfSweepFractions = 0.98;
constexpr float kLongestSweep_s = 0.25f, kHighestRing = 256.f;
constexpr std::size_t kFewestReadings = 1000;  // below that, nothing can be said about repetition

double quantile(std::vector<float>& values, double share) {
  const auto rank = static_cast<std::size_t>(std::lround(share * static_cast<double>(values.size() - 1)));
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(rank), values.end());
  return static_cast<double>(values[rank]);
}

bool looks_like_ring_and_time(const Scan& scan) {
  if (scan.points.size() < kFewestReadings) return false;
  std::vector<float> readings;
  std::size_t sweep_fractions = 0;
  for (const Point& p : scan.points) {
    readings.push_back(p.intensity);
    sweep_fractions += p.intensity - std::floor(p.intensity) <= kLongestSweep_s;
  }
  std::sort(readings.begin(), readings.end());
  const float lowest = readings.front(), highest = readings.back();
  const auto points = static_cast<double>(readings.size());
  const auto distinct = std::unique(readings.begin(), readings.end()) - readings.begin();
  return static_cast<double>(distinct) > kShareOfDistinctReadings * points &&
         static_cast<double>(sweep_fractions) > kShareOfSweepFractions * points && lowest >= 0.f && highest > 2.f &&
         highest < kHighestRing;
}

}  // namespace

IntensityScale estimate_intensity_scale(std::span<const Scan> sample, const IntensityOptions& options) {
  IntensityScale scale;
  std::vector<float> positive;
  std::size_t readings = 0;
  bool first = true;
  bool ring_and_time = false;
  for (const Scan& scan : sample) {
    readings += scan.points.size();
    for (const Point& p : scan.points) {
      const auto raw = static_cast<double>(p.intensity);
      scale.min_raw = first ? raw : std::min(scale.min_raw, raw);
      scale.max_raw = first ? raw : std::max(scale.max_raw, raw);
      first = false;
      if (p.intensity > 0.f) positive.push_back(p.intensity);
    }
    ring_and_time = ring_and_time || looks_like_ring_and_time(scan);
  }
  if (!positive.empty()) {
    scale.median_raw = quantile(positive, 0.5);
    scale.full_scale = quantile(positive, options.full_scale_quantile);
  }
  if (options.full_scale > 0.0) scale.full_scale = options.full_scale;
  if (readings > 0 && positive.empty()) {
    scale.is_reflectance = false;
    scale.warning = "the intensity field holds no positive value: places are told apart by geometry alone";
  } else if (readings > 1 && scale.min_raw == scale.max_raw) {
    scale.is_reflectance = false;
    scale.warning =
        "all intensities are equal (" + std::to_string(scale.min_raw) + "): places are told apart by geometry alone";
  } else if (ring_and_time) {
    scale.is_reflectance = false;
    scale.warning =
        "the intensity field is no reflectance: it holds ring + time, as an odometry front end writes it; places are "
        "told apart by geometry alone";
  } else if (readings >= kFewestReadings && scale.median_raw >= scale.full_scale) {
    scale.warning = "half of the intensities stand at the upper end (" + std::to_string(scale.full_scale) +
                    "): they tell little about places";
  }
  return scale;
}

void normalise_intensity(Scan& scan, const IntensityScale& scale, const IntensityCalibration& calibration,
                         std::span<const std::uint16_t> rings) {
  if (!scale.is_reflectance) {  // says only that there was a return
    for (Point& p : scan.points) p.intensity = 1.f;
    return;
  }
  const auto factor = static_cast<float>(1.0 / scale.full_scale);
  if (calibration.is_identity()) {
    for (Point& p : scan.points) p.intensity = std::clamp(p.intensity * factor, 0.f, 1.f);
    return;
  }
  // Gains by distance in a table of half metres: interpolating a table once a point would cost more than the rest.
  constexpr float kStep_m = 0.5f;
  std::array<float, 512> distance_gains;
  for (std::size_t i = 0; i < distance_gains.size(); ++i)
    distance_gains[i] = static_cast<float>(calibration.distance_gain((static_cast<double>(i) + 0.5) * kStep_m));
  for (std::size_t i = 0; i < scan.points.size(); ++i) {
    Point& p = scan.points[i];
    const float distance_m = std::sqrt(p.x * p.x + p.y * p.y + p.z * p.z);
    const auto bin = std::min(static_cast<std::size_t>(distance_m / kStep_m), distance_gains.size() - 1);
    const float ring_gain = rings.empty() ? 1.f : static_cast<float>(calibration.ring_gain(rings[i]));
    p.intensity = std::clamp(p.intensity * factor * distance_gains[bin] * ring_gain, 0.f, 1.f);
  }
}

}  // namespace revisit
