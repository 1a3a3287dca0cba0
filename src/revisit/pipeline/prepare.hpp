// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>

#include <revisit/config/parameters.hpp>
#include <revisit/core/intensity_calibration.hpp>
#include <revisit/core/log.hpp>
#include <revisit/core/result.hpp>
#include <revisit/core/scan.hpp>
#include <revisit/core/trajectory_point.hpp>
#include <revisit/core/twist.hpp>
#include <revisit/descriptors/intensity_scan_context.hpp>
#include <revisit/preprocess/ground.hpp>
#include <revisit/preprocess/intensity.hpp>
#include <revisit/registration/scan_geometry.hpp>

namespace revisit {

/// A scan made ready: filtered by range, ground found, intensity in [0, 1], sweep compensated; then described and
/// thinned.
struct PreparedScan {
  Scan scan;
  GroundSegmentation ground;
  IntensityScanContext descriptor;
  double ground_z_m = 0.0;                       ///< height of the ground in the frame of the sensor, were it upright
  ThinCloud cloud;                               ///< for registration; the ground is kept and marked
  std::shared_ptr<const ScanGeometry> geometry;  ///< of the cloud, where it was needed already
  std::optional<TrajectoryPoint> trajectory_point;  ///< by odometry, where it is known

  struct Milliseconds {
    double filter = 0.0, ground = 0.0, intensity = 0.0, describe = 0.0, thin = 0.0;
  } ms;
};

/// The paper's sections III-A and III-B in order. With the sensor's `motion`, the sweep is compensated after the ground
/// was found. A scan of a tilted sensor (Scan::up, or else by its ground) is set upright while its ground is found and
/// it is described (ThinCloud::up); its points stay in the sensor's frame. An error says why the scan describes no
/// place.
Result<PreparedScan> prepare_scan(Scan scan, const Parameters& parameters, const IntensityScale& scale,
                                  const IntensityCalibration& calibration = {},
                                  const std::optional<Twist>& motion = std::nullopt);

/// prepare_scan() for one scan after the other of one sensor: learns the intensity scale from the first ones, and says
/// once what it found out about the sensor. Belongs to one thread at a time.
class ScanPreparation {
 public:
  ScanPreparation(const Parameters& parameters, const std::optional<IntensityScale>& scale,
                  IntensityCalibration calibration, LogSink log);

  Result<PreparedScan> prepare(Scan scan, const std::optional<Twist>& motion = std::nullopt);

  const IntensityScale& intensity_scale() const { return scale_.scale(); }
  void set_intensity_scale(const IntensityScale& scale) { scale_.set(scale); }
  void archive(auto& fields) { fields(scale_, has_reported_rings_, reported_warning_); }

 private:
  void report(const GroundSegmentation& ground);

  Parameters parameters_;
  IntensityScaleLearner scale_;
  IntensityCalibration calibration_;
  LogSink log_;
  bool has_reported_rings_ = false;
  std::string reported_warning_;
};

}  // namespace revisit
