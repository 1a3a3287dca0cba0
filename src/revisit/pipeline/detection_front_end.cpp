// SPDX-License-Identifier: Apache-2.0
#include <revisit/pipeline/detection_front_end.hpp>

#include <utility>

#include <revisit/core/stopwatch.hpp>
#include <revisit/preprocess/range_filter.hpp>

namespace revisit {
namespace {

constexpr double kLongestUnconfirmed_s = 1.0;  // that odometry is believed
constexpr double kLongestGap_s = 5.0;          // after which it may find its map again
constexpr double kGap_m = 0.5;                 // what odometry may be off once it is back on its map

}  // namespace

DetectionFrontEnd::DetectionFrontEnd(const Parameters& parameters, const std::optional<IntensityScale>& scale,
                                     IntensityCalibration calibration, LogSink log)
    : parameters_(require_valid(parameters)), preparation_(parameters, scale, std::move(calibration), std::move(log)) {}

Result<DetectionFrontEnd::Step> DetectionFrontEnd::step(Scan scan) {
  Stopwatch watch;
  filter_range(scan, parameters_.preprocess);
  const OdometryStep step = odometry_.follow(scan);
  const double odometry_ms = watch.lap_ms();
  if (step.up) scan.up = step.up;
  auto previous = compensated_previous(step);
  awaits_motion_ = !step.motion && !scan.times_s.empty() ? std::optional(scan) : std::nullopt;
  auto prepared = preparation_.prepare(std::move(scan), step.motion);
  if (!prepared) {
    previous_.reset();
    awaits_motion_.reset();
    pass(step);
    return prepared.error();
  }
  prepared->geometry = std::make_shared<ScanGeometry>(prepared->cloud);
  prepared->trajectory_point = point_ = next_point(step, *prepared);
  previous_ = prepared->geometry;
  if (!awaits_motion_) narrow_view_.widen(*prepared);
  return Step{*std::move(prepared), odometry_ms, awaits_motion_.has_value(), std::move(previous)};
}

// The first scan of a drive, and the first after a loss of track: the motion to the next one was that of its sweep,
// too.
std::optional<PreparedScan> DetectionFrontEnd::compensated_previous(const OdometryStep& step) {
  auto scan = std::exchange(awaits_motion_, std::nullopt);
  if (!scan || !step.is_connected || !step.motion) return std::nullopt;
  auto prepared = preparation_.prepare(*std::move(scan), step.motion);
  if (!prepared) return std::nullopt;
  prepared->geometry = previous_ = std::make_shared<ScanGeometry>(prepared->cloud);
  prepared->trajectory_point = point_;
  return *std::move(prepared);
}

// On the segment of the scan before, where odometry is sure of the motion and the scans themselves confirm it.
TrajectoryPoint DetectionFrontEnd::next_point(const OdometryStep& step, PreparedScan& prepared) {
  const bool has_both = step.is_connected && previous_;
  TrajectoryPoint point;
  if (has_both && typical_.add(*previous_, *prepared.geometry, step.T_previous_lidar)) {
    point = point_.after(step.T_previous_lidar);
    confirmed_s_ = step.stamp_s;
  } else {
    typical_.interrupt();
    if (goes_on(step, has_both)) {
      point = point_after_gap(step, kGap_m);
    } else {
      point.origin = ++origins_;
      confirmed_s_.reset();
    }
    point.segment = point_.segment + 1;
  }
  if (step.is_tracked) tracked_ = {point, step.segment, step.T_odom_lidar, step.stamp_s};
  return point;
}

// Whether odometry is back on the map that it had. What nothing confirms, where it predicts the scan to be or where
// scans contradict it, counts only after scans confirmed it: those that lie far apart never do.
bool DetectionFrontEnd::goes_on(const OdometryStep& step, bool is_contradicted) const {
  if (!tracked_ || tracked_->segment != step.segment) return false;
  if (step.is_tracked && !is_contradicted) return step.stamp_s - tracked_->stamp_s <= kLongestGap_s;
  return confirmed_s_ && step.stamp_s - *confirmed_s_ <= kLongestUnconfirmed_s;
}

// What is predicted may be off by all that it says to have moved.
TrajectoryPoint DetectionFrontEnd::point_after_gap(const OdometryStep& step, double gap_m) const {
  const Pose T_tracked_lidar = tracked_->T_odom_lidar.inverse() * step.T_odom_lidar;
  const double predicted_m = step.is_tracked ? 0.0 : T_tracked_lidar.translation().norm();
  return tracked_->point.after_gap(T_tracked_lidar, gap_m + predicted_m);
}

// A scan that describes no place: odometry went on.
void DetectionFrontEnd::pass(const OdometryStep& step) {
  if (step.is_tracked && goes_on(step, false))
    tracked_ = {point_after_gap(step, 0.0), step.segment, step.T_odom_lidar, step.stamp_s};
}

}  // namespace revisit
