// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>
#include <optional>

#include <revisit/odometry/odometry.hpp>
#include <revisit/pipeline/detection.hpp>
#include <revisit/pipeline/place_recognition.hpp>
#include <revisit/verification/typical_agreement.hpp>

namespace revisit {

/// Scans in, loops out, online. Takes scans as a driver delivers them: with NaN and (0,0,0), with intensities in any
/// unit, swept or not. Frames increase. Belongs to one thread at a time.
class LoopDetector {
 public:
  /// Without a `scale`, the first ten scans decide it. `clouds` keeps what a place is registered by: in memory some 80
  /// kB each, or in a file (clouds_in_file()). Throws std::invalid_argument for parameters out of range.
  explicit LoopDetector(const Parameters& parameters = {}, const std::optional<IntensityScale>& scale = std::nullopt,
                        IntensityCalibration calibration = {}, LogSink log = {},
                        std::unique_ptr<PlaceClouds> clouds = clouds_in_memory());

  /// Looks for the scan's place among those old enough (exclusion of the recent past), then adds it.
  /// `T_world_lidar`, if there is one, is recorded as evidence and never used to decide.
  /// An error says why this scan describes no place; the detector goes on with the next.
  Result<Detection> process(Scan scan, const std::optional<Pose>& T_world_lidar = std::nullopt);

  /// Adds a place without looking for it: a map is made.
  Status add(Scan scan, const std::optional<Pose>& T_world_lidar = std::nullopt);

  /// Looks for the scan's place among all that were added, and adds nothing.
  Result<Detection> localise(Scan scan);

  /// Takes over `temporal` and `geometric`, from the next scan on. Throws std::invalid_argument likewise.
  void set_verification(const Parameters& parameters) { recognition_.set_verification(require_valid(parameters)); }

  const PlaceIndex& index() const { return recognition_.index(); }

 private:
  struct Prepared {
    PreparedScan scan;
    double odometry_ms = 0.0;
  };
  Result<Prepared> follow_and_prepare(Scan scan);
  TrajectoryPoint next_point(const OdometryStep& step, PreparedScan& prepared);
  Status remember(PreparedScan prepared, const std::optional<Pose>& T_world_lidar);

  Parameters parameters_;
  Odometry odometry_;
  ScanPreparation preparation_;
  PlaceRecognition recognition_;
  TypicalAgreementEstimate typical_;
  TrajectoryPoint point_;  ///< of the last scan
  struct Tracked {
    TrajectoryPoint point;
    int segment = 0;  ///< of odometry
    Pose T_odom_lidar = Pose::Identity();
  };
  std::optional<Tracked> tracked_;                ///< the last scan that odometry tracked
  int origins_ = 0;                               ///< of trajectory points, so far
  std::shared_ptr<const ScanGeometry> previous_;  ///< likewise; null where it described no place
  std::map<FrameId, Pose> T_world_places_;        ///< of places that came with a pose
};

}  // namespace revisit
