// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include <revisit/core/intensity_calibration.hpp>
#include <revisit/core/result.hpp>

namespace revisit {

/// Intensity calibration as JSON (docs/formats.md): what `revisit calibrate` writes and `--calibration` reads.
/// Knots must increase, gains must be positive and finite.
Result<IntensityCalibration> read_calibration(const std::filesystem::path& file);
Status write_calibration(const std::filesystem::path& file, const IntensityCalibration& calibration);

}  // namespace revisit
