// SPDX-License-Identifier: Apache-2.0
#include <revisit/pipeline/loop_detector.hpp>

#include <stdexcept>
#include <utility>

#include <revisit/core/text.hpp>

namespace revisit {

LoopDetector::LoopDetector(const Parameters& parameters, const std::optional<IntensityScale>& scale,
                           IntensityCalibration calibration, LogSink log, std::unique_ptr<PlaceClouds> clouds)
    : front_end_(parameters, scale, std::move(calibration), std::move(log)),
      recognition_(parameters, std::move(clouds)) {
  recognition_.expect_one_drive();
}

Result<Detection> LoopDetector::process(Scan scan, const std::optional<Pose>& T_world_lidar) {
  auto prepared = follow(std::move(scan));
  if (!prepared) return prepared.error();
  PreparedScan& query = prepared->scan;
  const std::size_t places = index().searchable({query.scan.frame, query.scan.stamp_s});
  auto detection = recognition_.find(query, places, front_end_.typical().recent());
  if (!detection) return detection.error();
  detection->odometry_ms = prepared->odometry_ms;
  auto earlier = recognition_.follow_back(*detection, query.trajectory_point, front_end_.typical().recent());
  if (!earlier) return earlier.error();
  detection->earlier = *std::move(earlier);
  if (T_world_lidar) T_world_scans_[query.scan.frame] = *T_world_lidar;
  set_pose_by_odometry(*detection);
  for (Detection& each : detection->earlier) set_pose_by_odometry(each);
  waiting_ = std::move(query);
  if (!prepared->awaits_motion)
    if (const Status status = add_waiting(); !status) return status.error();
  return detection;
}

Status LoopDetector::add(Scan scan, const std::optional<Pose>& T_world_lidar) {
  auto prepared = follow(std::move(scan));
  if (!prepared) return prepared.error();
  if (T_world_lidar) T_world_scans_[prepared->scan.scan.frame] = *T_world_lidar;
  return recognition_.add(std::move(prepared->scan));
}

Result<Detection> LoopDetector::localise(Scan scan) {
  if (const Status status = add_waiting(); !status) return status.error();
  const auto prepared = front_end_.prepare(std::move(scan));
  if (!prepared) return prepared.error();
  return recognition_.find(*prepared, index().size(), front_end_.typical().overall());
}

Result<DetectionFrontEnd::Step> LoopDetector::follow(Scan scan) {
  const std::size_t places = index().size();
  if (const auto last = waiting_     ? std::optional(waiting_->scan.frame)
                        : places > 0 ? std::optional(index().frame(places - 1))
                                     : std::nullopt;
      last && scan.frame <= *last)
    throw std::invalid_argument(to_text(scan.frame) + " after " + to_text(*last) + "; allowed: increasing frames");
  auto step = front_end_.step(std::move(scan));
  if (step && step->previous) waiting_ = *std::exchange(step->previous, std::nullopt);
  if (const Status status = add_waiting(); !status) return status.error();
  return step;
}

Status LoopDetector::add_waiting() {
  if (!waiting_) return ok();
  return recognition_.add(*std::exchange(waiting_, std::nullopt));
}

void LoopDetector::set_pose_by_odometry(Detection& detection) const {
  if (!detection.answer) return;
  const auto query = T_world_scans_.find(detection.frame), match = T_world_scans_.find(detection.answer->match);
  if (query == T_world_scans_.end() || match == T_world_scans_.end()) return;
  detection.T_match_query_by_odometry = match->second.inverse() * query->second;
}

}  // namespace revisit
