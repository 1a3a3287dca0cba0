// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <optional>

#include <revisit/config/parameters.hpp>
#include <revisit/core/intensity_calibration.hpp>
#include <revisit/core/log.hpp>
#include <revisit/core/result.hpp>
#include <revisit/core/scan.hpp>
#include <revisit/core/twist.hpp>
#include <revisit/descriptors/intensity_scan_context.hpp>
#include <revisit/io/recording.hpp>
#include <revisit/pipeline/loop_track.hpp>
#include <revisit/preprocess/ground.hpp>
#include <revisit/preprocess/intensity.hpp>
#include <revisit/registration/feature_alignment.hpp>

namespace revisit {

/// A scan made ready: filtered by range, ground found, intensity in [0, 1]; then described and thinned.
struct PreparedScan {
  Scan scan;
  GroundSegmentation ground;
  IntensityScanContext descriptor;
  double ground_z_m = 0.0;                       ///< where the ground lies below the sensor, were it upright
  ThinCloud cloud;                               ///< for registration; the ground is kept and marked
  std::shared_ptr<const ScanGeometry> geometry;  ///< of the cloud, where somebody has asked for it already
  std::optional<Station> station;                ///< where it was taken along the sensor's way, where that is known
  /// How much of the last few scans fitted the one before each, where that is known.
  std::optional<double> usual_inlier_ratio;

  struct Milliseconds {
    double filter = 0.0, ground = 0.0, intensity = 0.0, describe = 0.0, thin = 0.0;
  } ms;
};

/// The paper's sections III-A and III-B in order; with the sensor's `motion`, the distortion of the sweep is undone
/// after the ground is found. A scan of a tilted sensor is set upright while its ground is found and it is described
/// (ThinCloud::up); its points stay as they are. An error says why the scan describes no place.
Result<PreparedScan> prepare_scan(Scan scan, const Parameters& parameters, const IntensityScale& scale,
                                  const IntensityCalibration& calibration = {},
                                  const std::optional<Twist>& motion = std::nullopt);

/// The intensity scale of a recording, from up to ten readable scans spread over it.
/// An error where none of them is readable: the first one's.
Result<IntensityScale> estimate_intensity_scale(const Recording& recording, const Parameters& parameters);

/// Milliseconds since the previous call (or construction), of a clock that never jumps.
class Stopwatch {
 public:
  Stopwatch();
  double lap_ms();

 private:
  double last_ms_;
};

}  // namespace revisit
