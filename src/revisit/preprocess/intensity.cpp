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
constexpr double kFullScaleQuantile = 0.98;    // of the positive readings; the rest is retro-reflectors

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

void IntensityScaleLearner::add(const Scan& scan) {
  if (is_settled()) return;
  for (const Point& p : scan.points) {
    const auto raw = static_cast<double>(p.intensity);
    scale_.min_raw = readings_ == 0 ? raw : std::min(scale_.min_raw, raw);
    scale_.max_raw = readings_ == 0 ? raw : std::max(scale_.max_raw, raw);
    ++readings_;
    if (p.intensity > 0.f) positive_.push_back(p.intensity);
  }
  has_ring_and_time_ = has_ring_and_time_ || looks_like_ring_and_time(scan);
  ++scans_;
  update();
  if (is_settled()) positive_ = {};
}

void IntensityScaleLearner::set(const IntensityScale& scale) {
  scale_ = scale;
  scans_ = kScans;
  positive_ = {};
}

void IntensityScaleLearner::update() {
  scale_.is_reflectance = true;
  scale_.warning.clear();
  if (!positive_.empty()) {
    scale_.median_raw = quantile(positive_, 0.5);
    scale_.full_scale = quantile(positive_, kFullScaleQuantile);
  }
  if (options_.full_scale > 0.0) scale_.full_scale = options_.full_scale;
  const auto refuse = [&](const std::string& what) {
    scale_.is_reflectance = false;
    scale_.warning = what + ": places are told apart by geometry alone";
  };
  if (readings_ > 0 && positive_.empty())
    refuse("the intensity field holds no positive value");
  else if (readings_ > 1 && scale_.min_raw == scale_.max_raw)
    refuse("all intensities are equal (" + std::to_string(scale_.min_raw) + ")");
  else if (has_ring_and_time_)
    refuse("the intensity field is no reflectance but holds ring + time, as an odometry front end writes it");
  else if (readings_ >= kFewestReadings && scale_.median_raw >= scale_.full_scale)
    scale_.warning = "half of the intensities stand at the upper end (" + std::to_string(scale_.full_scale) +
                     "): they tell little about places";
}

IntensityScale estimate_intensity_scale(std::span<const Scan> sample, const IntensityOptions& options) {
  IntensityScaleLearner learner(options);
  for (const Scan& scan : sample) learner.add(scan);
  return learner.scale();
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
