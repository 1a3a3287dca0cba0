// SPDX-License-Identifier: Apache-2.0
#include <revisit/pipeline/detection_front_end.hpp>

#include <utility>

#include <revisit/core/stopwatch.hpp>
#include <revisit/preprocess/range_filter.hpp>

namespace revisit {
namespace {

constexpr double kGap_m = 0.5;  // what odometry may be off once it is back on its map

}  // namespace

DetectionFrontEnd::DetectionFrontEnd(const Parameters& parameters, const std::optional<IntensityScale>& scale,
                                     IntensityCalibration calibration, LogSink log)
    : parameters_(require_valid(parameters)),
      odometry_(Odometry::Source::kLidar, ScanMatcher::kCoarse),
      preparation_(parameters, scale, std::move(calibration), std::move(log)) {}

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
    point_ = {.segment = point_.segment + 1, .origin = ++origins_};
    return prepared.error();
  }
  prepared->geometry = std::make_shared<ScanGeometry>(prepared->cloud);
  prepared->trajectory_point = point_ = next_point(step, *prepared);
  previous_ = prepared->geometry;
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
  const bool is_connected =
      step.is_connected && previous_ && typical_.add(*previous_, *prepared.geometry, step.T_previous_lidar);
  TrajectoryPoint point;
  if (is_connected) {
    point = point_.after(step.T_previous_lidar);
  } else {
    typical_.interrupt();
    // Back on the map that it was lost on for a moment; else, nothing is known any more.
    const bool is_back = step.is_tracked && !step.is_connected && tracked_ && tracked_->segment == step.segment;
    point = is_back ? tracked_->point.after_gap(tracked_->T_odom_lidar.inverse() * step.T_odom_lidar, kGap_m)
                    : TrajectoryPoint{.origin = ++origins_};
    point.segment = point_.segment + 1;
  }
  if (step.is_tracked) tracked_ = {point, step.segment, step.T_odom_lidar};
  return point;
}

}  // namespace revisit
