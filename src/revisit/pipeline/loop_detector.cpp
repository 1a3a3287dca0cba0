// SPDX-License-Identifier: Apache-2.0
#include <revisit/pipeline/loop_detector.hpp>

#include <stdexcept>
#include <utility>

#include <revisit/core/stopwatch.hpp>
#include <revisit/core/text.hpp>
#include <revisit/preprocess/range_filter.hpp>

namespace revisit {
namespace {

constexpr double kGap_m = 0.5;  // what odometry may be off once it is back on its map

}  // namespace

LoopDetector::LoopDetector(const Parameters& parameters, const std::optional<IntensityScale>& scale,
                           IntensityCalibration calibration, LogSink log, std::unique_ptr<PlaceClouds> clouds)
    : parameters_(require_valid(parameters)),
      odometry_(Odometry::Source::kLidar, ScanMatcher::kCoarse),
      preparation_(parameters, scale, std::move(calibration), std::move(log)),
      recognition_(parameters, std::move(clouds)) {}

Result<Detection> LoopDetector::process(Scan scan, const std::optional<Pose>& T_world_lidar) {
  auto prepared = follow_and_prepare(std::move(scan));
  if (!prepared) return prepared.error();
  PreparedScan& query = prepared->scan;
  const std::size_t places = index().searchable({query.scan.frame, query.scan.stamp_s});
  auto detection = recognition_.find(query, places, typical_.recent());
  if (!detection) return detection.error();
  detection->odometry_ms = prepared->odometry_ms;
  if (detection->answer && T_world_lidar)
    if (const auto T_world_match = T_world_places_.find(detection->answer->match);
        T_world_match != T_world_places_.end())
      detection->T_match_query_by_odometry = T_world_match->second.inverse() * *T_world_lidar;
  if (const Status status = remember(std::move(query), T_world_lidar); !status) return status.error();
  return detection;
}

Status LoopDetector::add(Scan scan, const std::optional<Pose>& T_world_lidar) {
  auto prepared = follow_and_prepare(std::move(scan));
  if (!prepared) return prepared.error();
  return remember(std::move(prepared->scan), T_world_lidar);
}

Result<Detection> LoopDetector::localise(Scan scan) {
  const auto prepared = preparation_.prepare(std::move(scan));
  if (!prepared) return prepared.error();
  return recognition_.find(*prepared, index().size(), typical_.overall());
}

Result<LoopDetector::Prepared> LoopDetector::follow_and_prepare(Scan scan) {
  if (const std::size_t places = index().size(); places > 0 && scan.frame <= index().frame(places - 1))
    throw std::invalid_argument(to_text(scan.frame) + " after " + to_text(index().frame(places - 1)) +
                                "; allowed: increasing frames");
  Stopwatch watch;
  filter_range(scan, parameters_.preprocess);
  const OdometryStep step = odometry_.follow(scan);
  const double odometry_ms = watch.lap_ms();
  if (step.up) scan.up = step.up;
  auto prepared = preparation_.prepare(std::move(scan), step.motion);
  if (!prepared) {
    previous_.reset();
    point_ = {.segment = point_.segment + 1, .origin = ++origins_};
    return prepared.error();
  }
  prepared->geometry = std::make_shared<ScanGeometry>(prepared->cloud);
  prepared->trajectory_point = point_ = next_point(step, *prepared);
  previous_ = prepared->geometry;
  return Prepared{*std::move(prepared), odometry_ms};
}

// On the segment of the scan before, where odometry is sure of the motion and the scans themselves confirm it.
TrajectoryPoint LoopDetector::next_point(const OdometryStep& step, PreparedScan& prepared) {
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

Status LoopDetector::remember(PreparedScan prepared, const std::optional<Pose>& T_world_lidar) {
  if (T_world_lidar) T_world_places_[prepared.scan.frame] = *T_world_lidar;
  return recognition_.add(std::move(prepared));
}

}  // namespace revisit
