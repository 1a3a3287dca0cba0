// SPDX-License-Identifier: Apache-2.0
#include <revisit/pipeline/calibrate_recording.hpp>

#include <algorithm>
#include <optional>

#include <revisit/odometry/odometry.hpp>
#include <revisit/pipeline/recording_scale.hpp>
#include <revisit/preprocess/intensity.hpp>
#include <revisit/preprocess/range_filter.hpp>
#include <revisit/preprocess/rings.hpp>

namespace revisit {
namespace {

// Segments that odometry does not connect must not meet in the same patches of the world.
constexpr double kSegmentsApart_m = 1500.0;
// That tell elevations: with 16 or 32, the ground between the lines says 0.1 degrees where nothing is off.
constexpr std::size_t kFewestRings = 60;

}  // namespace

Result<RecordingCalibration> calibrate_recording(const Recording& recording, const Parameters& parameters,
                                                 std::size_t most_scans, const LogSink& log,
                                                 const std::function<bool(std::size_t, std::size_t)>& progress) {
  const auto scale = intensity_scale_of(recording, parameters.intensity);
  if (!scale) return scale.error();
  if (!scale->is_reflectance) return Error{"nothing to calibrate: " + scale->warning};
  CalibrationLearner learner;
  ElevationLearner elevations;
  Odometry odometry;
  const bool has_poses = recording.trajectory().entries.size() >= 2;
  if (!has_poses) log_to(log, LogLevel::kInfo, "the recording has no poses: odometry gives them");
  const std::size_t count = std::min(recording.size(), most_scans);
  std::optional<std::size_t> ring_count;
  for (std::size_t i = 0; i < count; ++i) {
    if (!progress(i, count))
      return Error{"stopped after " + std::to_string(i) + " of " + std::to_string(count) + " scans"};
    auto scan = recording.read(i);
    if (!scan) {
      log_to(log, LogLevel::kWarning, scan.error().message + "; skipped");
      continue;
    }
    filter_range(*scan, parameters.preprocess);
    std::optional<Pose> T_world_lidar = recording.trajectory().at(recording.frame(i));
    if (!has_poses) {
      OdometryStep step = odometry.follow(*scan);
      if (!step.is_tracked) continue;
      if (!step.compensated.empty()) scan->points = std::move(step.compensated);
      T_world_lidar = step.T_odom_lidar;
      T_world_lidar->translation().x() += kSegmentsApart_m * step.segment;
    }
    if (!T_world_lidar) continue;
    const Rings rings = find_rings(*scan);
    // Ring numbers mean the same laser only where as many rings were seen.
    if (!ring_count) ring_count = rings.count();
    if (*ring_count != rings.count()) {
      log_to(log, LogLevel::kInfo,
             "frame " + std::to_string(scan->frame.value) + " shows " + std::to_string(rings.count()) +
                 " rings instead of " + std::to_string(*ring_count) + ": left out");
      continue;
    }
    if (rings.count() >= kFewestRings) elevations.add(scan->points, *T_world_lidar);
    normalise_intensity(*scan, *scale);
    learner.add(*scan, rings.of_point, *T_world_lidar);
  }
  progress(count, count);
  const auto report = learner.solve();
  if (!report) return report.error();
  return RecordingCalibration{*report, elevations.solve()};
}

}  // namespace revisit
