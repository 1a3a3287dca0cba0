// SPDX-License-Identifier: Apache-2.0
#include <revisit/pipeline/calibrate_recording.hpp>

#include <algorithm>
#include <optional>

#include <revisit/pipeline/prepare.hpp>
#include <revisit/preprocess/range_filter.hpp>
#include <revisit/registration/icp.hpp>

namespace revisit {
namespace {

// Poses of neighbouring scans by registering each onto the one before, from a guess of constant velocity.
class ScanToScanOdometry {
 public:
  explicit ScanToScanOdometry(const Parameters& parameters) : parameters_(parameters) {}

  /// The pose in the frame of the run's first scan, or nothing where the scan fits none before: a new run begins.
  std::optional<Pose> add(const Scan& scan, const Rings& rings) {
    const auto ground = segment_ground(scan, rings, parameters_.preprocess);
    SurfaceCloud cloud(thin(scan.points, ground.is_ground, parameters_.geometric.voxel_m));
    if (!previous_) {
      previous_ = std::move(cloud);
      return T_first_last_;
    }
    const IcpResult icp = align_icp(*previous_, cloud.points(), T_last_step_);
    const Agreement agreement =
        measure_agreement(*previous_, cloud, icp.T_target_source, parameters_.geometric.inlier_distance_m);
    previous_ = std::move(cloud);
    if (!icp.converged || agreement.inlier_ratio < parameters_.geometric.min_inlier_ratio) {
      T_last_step_ = T_first_last_ = Pose::Identity();
      return std::nullopt;
    }
    T_last_step_ = icp.T_target_source;
    T_first_last_ = T_first_last_ * T_last_step_;
    return T_first_last_;
  }

 private:
  Parameters parameters_;
  std::optional<SurfaceCloud> previous_;
  Pose T_last_step_ = Pose::Identity(), T_first_last_ = Pose::Identity();
};

}  // namespace

Result<CalibrationReport> calibrate_recording(const Recording& recording, const Parameters& parameters,
                                              std::size_t most_scans, const LogSink& log,
                                              const std::function<bool(std::size_t, std::size_t)>& progress) {
  const auto scale = estimate_intensity_scale(recording, parameters);
  if (!scale) return scale.error();
  if (!scale->is_reflectance) return Error{"nothing to calibrate: " + scale->warning};
  CalibrationLearner learner;
  ScanToScanOdometry odometry(parameters);
  const bool has_poses = recording.trajectory().entries.size() >= 2;
  if (!has_poses) log_to(log, LogLevel::kInfo, "the recording has no poses: neighbouring scans are registered");
  const std::size_t count = std::min(recording.size(), most_scans);
  Eigen::Vector3d run_offset = Eigen::Vector3d::Zero();
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
    const Rings rings = find_rings(*scan);
    std::optional<Pose> T_world_lidar = recording.trajectory().at(recording.frame(i));
    if (!has_poses) {
      T_world_lidar = odometry.add(*scan, rings);
      if (!T_world_lidar) {
        // Runs that are not connected must not meet in the same patches of the world.
        constexpr double kRunsApart_m = 1500.0;
        run_offset.x() += kRunsApart_m;
        T_world_lidar = Pose::Identity();
        log_to(log, LogLevel::kInfo, "frame " + std::to_string(scan->frame.value) + " fits none before it: a new run");
      }
      T_world_lidar->pretranslate(run_offset);
    }
    if (!T_world_lidar) continue;
    // Ring numbers mean the same laser only where as many rings were seen.
    if (!ring_count) ring_count = rings.count();
    if (*ring_count != rings.count()) {
      log_to(log, LogLevel::kInfo,
             "frame " + std::to_string(scan->frame.value) + " shows " + std::to_string(rings.count()) +
                 " rings instead of " + std::to_string(*ring_count) + ": left out");
      continue;
    }
    normalise_intensity(*scan, *scale);
    learner.add(*scan, rings.of_point, *T_world_lidar);
  }
  progress(count, count);
  return learner.solve();
}

}  // namespace revisit
