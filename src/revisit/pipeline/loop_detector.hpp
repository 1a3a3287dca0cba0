// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>
#include <optional>

#include <revisit/pipeline/detection.hpp>
#include <revisit/pipeline/detection_front_end.hpp>
#include <revisit/pipeline/place_recognition.hpp>

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
  /// A loop also leads back to scans of the last metres that had none when they came (Detection::earlier).
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
  Result<DetectionFrontEnd::Step> follow(Scan scan);
  Status add_waiting();
  void set_pose_by_odometry(Detection& detection) const;

  DetectionFrontEnd front_end_;
  PlaceRecognition recognition_;
  std::optional<PreparedScan> waiting_;    ///< the last scan, where the next one shows how its sweep is compensated
  std::map<FrameId, Pose> T_world_scans_;  ///< of scans that came with a pose
};

}  // namespace revisit
