// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <functional>
#include <optional>

#include <revisit/config/parameters.hpp>
#include <revisit/core/log.hpp>
#include <revisit/core/result.hpp>
#include <revisit/io/recording.hpp>
#include <revisit/preprocess/calibration_learning.hpp>
#include <revisit/registration/elevation_offset.hpp>

namespace revisit {

struct RecordingCalibration : CalibrationReport {
  std::optional<ElevationOffset> elevation;  ///< beyond elevation_offset_deg of the parameters; of spinning sensors
};

/// Learns phi(eta, d) from a recording alone, its intensities brought to [0, 1] first. Poses come from the recording
/// where it has them; otherwise odometry gives them, and scans that it loses are left out.
/// Learns as well by how much all elevations are off.
/// `progress(done, total)` is called after each scan and stops the work by returning false.
Result<RecordingCalibration> calibrate_recording(const Recording& recording, const Parameters& parameters,
                                                 std::size_t most_scans, const LogSink& log,
                                                 const std::function<bool(std::size_t, std::size_t)>& progress);

}  // namespace revisit
