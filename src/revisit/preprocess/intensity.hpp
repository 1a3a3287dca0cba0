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
};

/// Decides the scale from a sample of a recording's scans, once for all of them: a quantile of the positive readings,
/// so that a heavy tail (retro-reflectors) does not squeeze the rest into darkness. Deterministic.
IntensityScale estimate_intensity_scale(std::span<const Scan> sample, const IntensityOptions& options);

/// Calibrates (phi of eq. 1) and normalises all intensities in place: eta <- min(1, phi(eta, d) / full_scale).
/// `rings` gives the laser ring of each point, or is empty where rings are unknown. A field that is no reflectance
/// becomes 1 everywhere.
void normalise_intensity(Scan& scan, const IntensityScale& scale, const IntensityCalibration& calibration = {},
                         std::span<const std::uint16_t> rings = {});

}  // namespace revisit
