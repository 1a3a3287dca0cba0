// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>
#include <vector>

#include <revisit/config/parameters.hpp>
#include <revisit/core/intensity_calibration.hpp>
#include <revisit/core/scan.hpp>

namespace revisit {

/// How the raw intensity of one recording becomes [0, 1].
struct IntensityScale {
  double full_scale = 1.0;                                ///< the reading that becomes 1; larger ones are cut to 1
  double min_raw = 0.0, median_raw = 0.0, max_raw = 0.0;  ///< over the sample
  bool is_reflectance = true;                             ///< false: the field plainly holds something else, or nothing
  std::string warning;                                    ///< empty, or what is wrong with the field

  void archive(auto& fields) { fields(full_scale, min_raw, median_raw, max_raw, is_reflectance, warning); }
};

/// Learns the scale from the first scans of a sensor and keeps it from then on: a quantile of the positive readings, so
/// that a heavy tail (retro-reflectors) does not squeeze the rest into darkness. Deterministic.
class IntensityScaleLearner {
 public:
  explicit IntensityScaleLearner(const IntensityOptions& options) : options_(options) {}
  /// The scans that a scale is learnt from: as many as `revisit detect` takes, spread over a recording.
  static constexpr std::size_t kScans = 10;

  /// From the scan number kScans on, nothing is learnt any more.
  void add(const Scan& scan);
  /// A scale that is known from elsewhere.
  void set(const IntensityScale& scale);
  /// Of the scans so far.
  const IntensityScale& scale() const { return scale_; }
  bool is_settled() const { return scans_ >= kScans; }
  void archive(auto& fields) { fields(scale_, positive_, scans_, readings_, has_ring_and_time_); }

 private:
  void update();

  IntensityOptions options_;
  IntensityScale scale_;
  std::vector<float> positive_;
  std::size_t scans_ = 0, readings_ = 0;
  bool has_ring_and_time_ = false;
};

/// The scale of a sample of scans. Deterministic.
IntensityScale estimate_intensity_scale(std::span<const Scan> sample, const IntensityOptions& options);

/// Calibrates (phi of eq. 1) and normalises all intensities in place: eta <- min(1, phi(eta, d) / full_scale).
/// `rings` gives the laser ring of each point, or is empty where rings are unknown. A field that is no reflectance
/// becomes 1 everywhere.
void normalise_intensity(Scan& scan, const IntensityScale& scale, const IntensityCalibration& calibration = {},
                         std::span<const std::uint16_t> rings = {});

}  // namespace revisit
