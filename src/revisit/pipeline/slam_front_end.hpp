// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>

#include <revisit/odometry/keyframe_selection.hpp>
#include <revisit/odometry/odometry.hpp>
#include <revisit/pipeline/narrow_view.hpp>
#include <revisit/pipeline/prepare.hpp>
#include <revisit/store/sensor_facts.hpp>
#include <revisit/store/stored_map.hpp>
#include <revisit/verification/typical_agreement.hpp>

namespace revisit {

/// The half of SLAM that sees every scan: follows the sensor, chooses key frames, and makes these ready.
/// Belongs to one thread at a time.
class SlamFrontEnd {
 public:
  SlamFrontEnd(const Parameters& parameters, Odometry::Source source, const std::optional<IntensityScale>& scale,
               const IntensityCalibration& calibration, const LogSink& log);

  struct Step {
    OdometryStep odometry;
    bool starts_segment = false;           ///< tracking had been lost before
    std::optional<PreparedScan> keyframe;  ///< where the scan becomes one
    double odometry_ms = 0.0, prepare_ms = 0.0;
  };
  /// An error where the scan holds no point within the range filter, or where it should be the first key frame but
  /// describes no place. Others that describe no place become no key frames.
  Result<Step> step(Scan scan, const std::optional<Pose>& T_external_lidar);
  /// The key frame of the last step was added to the graph.
  void accept_keyframe(const OdometryStep& odometry, const SeenSpace& seen);

  /// From the last key frame.
  Pose T_keyframe_lidar(const OdometryStep& odometry) const {
    return selection_.T_odom_last().inverse() * odometry.T_odom_lidar;
  }
  SensorFacts sensor() const { return {preparation_.intensity_scale(), typical_.overall(), typical_.pairs(), 0.0}; }
  /// Begins anew, elsewhere; segments count on from this one. `sensor`: what is known of it, in the session that goes
  /// on.
  void begin_at_segment(int segment, const std::optional<SensorFacts>& sensor = std::nullopt);
  void archive(auto& fields) {
    fields(odometry_, selection_, preparation_, typical_, narrow_view_, is_narrow_, keyframe_segment_, previous_cloud_);
    if (fields.kReads) previous_ = previous_cloud_ ? std::make_shared<ScanGeometry>(*previous_cloud_) : nullptr;
  }

 private:
  Result<PreparedScan> prepare(Scan scan, const OdometryStep& odometry);
  void set_previous(const PreparedScan* scan);
  bool makes_a_pair(const OdometryStep& odometry) const;
  void report(FrameId frame, const OdometryStep& odometry) const;

  Parameters parameters_;
  LogSink log_;
  Odometry odometry_;
  KeyframeSelection selection_;
  ScanPreparation preparation_;
  TypicalAgreementEstimate typical_;
  NarrowView narrow_view_;
  bool is_narrow_ = false;               ///< the sensor: every scan is made ready, for what it shows beside key frames
  std::optional<int> keyframe_segment_;  ///< of the last key frame, if there is one
  // Of the scan before, where it was a key frame and pairs are learnt.
  std::optional<ThinCloud> previous_cloud_;
  std::shared_ptr<const ScanGeometry> previous_;
};

}  // namespace revisit
