// SPDX-License-Identifier: Apache-2.0
#include <revisit/pipeline/slam_front_end.hpp>

#include <string>
#include <utility>

#include <revisit/core/stopwatch.hpp>
#include <revisit/core/text.hpp>
#include <revisit/preprocess/range_filter.hpp>

namespace revisit {
namespace {

// Pairs of consecutive scans after which their typical agreement is known: its mean is then within 1 %.
constexpr std::size_t kTypicalPairs = 40;

}  // namespace

SlamFrontEnd::SlamFrontEnd(const Parameters& parameters, Odometry::Source source,
                           const std::optional<IntensityScale>& scale, const IntensityCalibration& calibration,
                           const LogSink& log)
    : parameters_(parameters),
      log_(log),
      odometry_(source),
      selection_(parameters.slam),
      preparation_(parameters, scale, calibration, log) {}

Result<SlamFrontEnd::Step> SlamFrontEnd::step(Scan scan, const std::optional<Pose>& T_external_lidar) {
  filter_range(scan, parameters_.preprocess);
  if (scan.points.empty())
    return Error{to_text(scan.frame) + ": no point between " + std::to_string(parameters_.preprocess.min_range_m) +
                 " and " + std::to_string(parameters_.preprocess.max_range_m) + " m"};
  Stopwatch watch;
  Step step;
  step.odometry = odometry_.follow(scan, T_external_lidar);
  const OdometryStep& odometry = step.odometry;
  step.odometry_ms = watch.lap_ms();
  report(scan.frame, odometry);

  step.starts_segment = keyframe_segment_ && odometry.segment != *keyframe_segment_;
  const bool is_keyframe = !keyframe_segment_ || step.starts_segment ||
                           (odometry.is_tracked &&
                            selection_.is_keyframe(odometry.T_odom_lidar,
                                                   odometry.compensated.empty() ? scan.points : odometry.compensated));
  if (!is_keyframe && !makes_a_pair(odometry) && !is_narrow_) {
    set_previous(nullptr);
    return step;
  }
  scan.stamp_s = odometry.stamp_s;
  if (odometry.up) scan.up = odometry.up;
  auto prepared = prepare(std::move(scan), odometry);
  step.prepare_ms = watch.lap_ms();
  if (!prepared && !keyframe_segment_) return prepared.error();
  if (!prepared || !is_keyframe) {
    set_previous(nullptr);
    return step;
  }
  set_previous(&*prepared);
  step.keyframe = *std::move(prepared);
  return step;
}

void SlamFrontEnd::set_previous(const PreparedScan* scan) {
  previous_ = scan ? scan->geometry : nullptr;
  previous_cloud_ = previous_ ? std::optional(scan->cloud) : std::nullopt;
}

// Until the typical agreement is known, the scan after each key frame is looked at, too.
bool SlamFrontEnd::makes_a_pair(const OdometryStep& odometry) const {
  return previous_ && odometry.is_connected && typical_.pairs() < kTypicalPairs;
}

Result<PreparedScan> SlamFrontEnd::prepare(Scan scan, const OdometryStep& odometry) {
  auto prepared = preparation_.prepare(std::move(scan), odometry.motion);
  if (!prepared) return prepared;
  if (typical_.pairs() < kTypicalPairs) {
    prepared->geometry = std::make_shared<ScanGeometry>(prepared->cloud);
    if (makes_a_pair(odometry)) typical_.add(*previous_, *prepared->geometry, odometry.T_previous_lidar);
  }
  is_narrow_ = prepared->cloud.seen.sector().is_narrow();
  if (is_narrow_) narrow_view_.widen(*prepared, odometry);
  return prepared;
}

void SlamFrontEnd::accept_keyframe(const OdometryStep& odometry, const SeenSpace& seen) {
  selection_.set_last(odometry.T_odom_lidar, seen);
  keyframe_segment_ = odometry.segment;
}

void SlamFrontEnd::report(FrameId frame, const OdometryStep& odometry) const {
  if (odometry.stamp_was_replaced)
    log_to(log_, LogLevel::kWarning,
           to_text(frame) + ": its stamp is not after that of the scan before; a tenth of a second later is taken");
  if (odometry.lost)
    log_to(log_, LogLevel::kWarning,
           to_text(frame) +
               ": tracking is lost; a new segment of the trajectory begins, until its place in the map is found");
}

void SlamFrontEnd::begin_at_segment(int segment, const std::optional<SensorFacts>& sensor) {
  odometry_.begin_at_segment(segment);
  if (!sensor) return;
  typical_.restore(sensor->typical, sensor->typical_pairs);
  preparation_.set_intensity_scale(sensor->intensity_scale);
}

}  // namespace revisit
