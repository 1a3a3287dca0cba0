// SPDX-License-Identifier: Apache-2.0
#include <revisit/simulation/internal/odometry_model.hpp>

#include <cmath>

#include <revisit/simulation/internal/random.hpp>

namespace revisit::simulation_internal {
namespace {

// Applies `step`, which makes the measured motion out of the true one, from frame to frame.
template <typename Step>
Trajectory integrate(const Trajectory& truth, const Pose& start, Step step) {
  Trajectory result;
  Pose T = start;
  const Trajectory::Entry* before = nullptr;
  for (const auto& [frame, entry] : truth.entries) {
    if (before != nullptr)
      T = T * step(frame, entry.stamp_s - before->stamp_s, before->T_world_lidar.inverse() * entry.T_world_lidar);
    result.entries[frame] = {entry.stamp_s, T};
    before = &entry;
  }
  return result;
}

double normal(std::uint64_t seed, FrameId frame, std::uint64_t what) {
  return static_cast<double>(gaussian(mix(seed, static_cast<std::uint64_t>(frame.value), what)));
}

Pose flat(double forward_m, double left_m, double yaw_rad) {
  Pose T = Pose::Identity();
  T.translate(Eigen::Vector3d(forward_m, left_m, 0));
  T.rotate(Eigen::AngleAxisd(yaw_rad, Eigen::Vector3d::UnitZ()));
  return T;
}

}  // namespace

Trajectory wheel_odometry(const Trajectory& truth, std::uint64_t seed) {
  if (truth.empty()) return {};
  const Pose& first = truth.entries.begin()->second.T_world_lidar;
  const double scale = 1.0 + 0.008 * static_cast<double>(gaussian(mix(seed, 81)));
  const double turn_scale = 1.0 + 0.01 * static_cast<double>(gaussian(mix(seed, 82)));
  const Pose start = flat(first.translation().x(), first.translation().y(), yaw_of(first));
  return integrate(truth, start, [=](FrameId frame, double duration_s, const Pose& motion) {
    // Every fifteen seconds or so, for up to a second and a half, the wheels turn faster than the vehicle moves.
    const double time_s = static_cast<double>(frame.value) * 0.1;
    const auto stretch = static_cast<std::uint64_t>(time_s / 15.0);
    const double begin_s =
        15.0 * (static_cast<double>(stretch) + 0.8 * static_cast<double>(uniform(mix(seed, stretch, 83))));
    const bool slips =
        time_s >= begin_s && time_s < begin_s + 1.5 * static_cast<double>(uniform(mix(seed, stretch, 84)));
    const double slip = slips ? 1.0 + 0.35 * static_cast<double>(uniform(mix(seed, stretch, 85))) : 1.0;
    const double gyro_drift = 2e-4 * smooth_noise(mix(seed, 86), time_s / 60.0) * duration_s;
    return flat(motion.translation().x() * scale * slip + 0.002 * normal(seed, frame, 87),
                0.001 * normal(seed, frame, 88),
                yaw_of(motion) * turn_scale * (slips ? 1.05 : 1.0) + gyro_drift + 2e-4 * normal(seed, frame, 89));
  });
}

Trajectory drifting_odometry(const Trajectory& truth, std::uint64_t seed) {
  if (truth.empty()) return {};
  const double scale = 1.0 + 0.002 * static_cast<double>(gaussian(mix(seed, 91)));
  return integrate(truth, truth.entries.begin()->second.T_world_lidar, [=](FrameId frame, double, const Pose& motion) {
    const double time_s = static_cast<double>(frame.value) * 0.1;
    const auto draw = [&](std::uint64_t what) { return normal(seed, frame, 92 + what); };
    const auto slow = [&](std::uint64_t what) { return smooth_noise(mix(seed, 100 + what), time_s / 40.0); };
    const Eigen::Vector3d turn(5e-5 * draw(0), 5e-5 * draw(1), 1.5e-4 * draw(2) + 1.2e-4 * slow(2));
    Pose T = motion;
    T.translation() *= scale;
    T.translation() += Eigen::Vector3d(0.004 * draw(3), 0.003 * draw(4), 0.002 * draw(5) + 0.001 * slow(5));
    T.rotate(Eigen::AngleAxisd(turn.norm(),
                               turn.norm() > 0 ? Eigen::Vector3d(turn.normalized()) : Eigen::Vector3d::UnitX()));
    return T;
  });
}

}  // namespace revisit::simulation_internal
