// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>

#include <revisit/odometry/odometry.hpp>
#include <revisit/pipeline/narrow_view.hpp>
#include <revisit/pipeline/prepare.hpp>
#include <revisit/verification/typical_agreement.hpp>

namespace revisit {

/// The half of loop detection that comes before places: odometry says how the sensor moved, the scan is made ready, and
/// what scans of one place typically agree in is learnt. Frames increase. Belongs to one thread at a time.
class DetectionFrontEnd {
 public:
  /// Without a `scale`, the first ten scans decide it. Throws std::invalid_argument for parameters out of range.
  DetectionFrontEnd(const Parameters& parameters, const std::optional<IntensityScale>& scale,
                    IntensityCalibration calibration, LogSink log);

  struct Step {
    PreparedScan scan;  ///< with its geometry and trajectory point
    double odometry_ms = 0.0;
    bool awaits_motion = false;            ///< it was swept, and how the sensor moved is known with the next scan only
    std::optional<PreparedScan> previous;  ///< the scan before, if it did: with its sweep compensated
  };
  /// An error says why the scan describes no place; the next one may.
  Result<Step> step(Scan scan);
  /// A scan by itself: nobody knows how the sensor moved.
  Result<PreparedScan> prepare(Scan scan) { return preparation_.prepare(std::move(scan)); }

  const TypicalAgreementEstimate& typical() const { return typical_; }

 private:
  TrajectoryPoint next_point(const OdometryStep& step, PreparedScan& prepared);
  bool goes_on(const OdometryStep& step, bool is_contradicted) const;
  TrajectoryPoint point_after_gap(const OdometryStep& step, double gap_m) const;
  void pass(const OdometryStep& step);
  std::optional<PreparedScan> compensated_previous(const OdometryStep& step);

  Parameters parameters_;
  Odometry odometry_;
  ScanPreparation preparation_;
  TypicalAgreementEstimate typical_;
  NarrowView narrow_view_;
  TrajectoryPoint point_;  ///< of the last scan
  struct Tracked {
    TrajectoryPoint point;
    int segment = 0;  ///< of odometry
    Pose T_odom_lidar = Pose::Identity();
    double stamp_s = 0.0;
  };
  std::optional<Tracked> tracked_;                ///< the last scan that odometry tracked
  std::optional<double> confirmed_s_;             ///< when scans last confirmed its motion, since the origin
  std::optional<Scan> awaits_motion_;             ///< the last scan, where its sweep could not be compensated
  int origins_ = 0;                               ///< of trajectory points, so far
  std::shared_ptr<const ScanGeometry> previous_;  ///< likewise; null where it described no place
};

}  // namespace revisit
