// SPDX-License-Identifier: Apache-2.0
#include <revisit/simulation/internal/imu_model.hpp>

#include <cmath>

#include <revisit/core/twist.hpp>
#include <revisit/simulation/internal/random.hpp>

namespace revisit::simulation_internal {
namespace {

// A MEMS sensor as LiDARs have it inside (data sheets of the BMI085 and ICM-20948), on a vehicle whose engine runs.
struct Imu {
  static constexpr double kStep_s = 0.005;
  static constexpr double kGravity_mps2 = 9.81;
  static constexpr float kGyroNoise_radps = 0.003f, kGyroBias_radps = 0.004f;
  static constexpr float kAccelerationNoise_mps2 = 0.3f, kAccelerationBias_mps2 = 0.15f;
};

Eigen::Vector3f noise(std::uint64_t key) {
  return {gaussian(mix(key, 0)), gaussian(mix(key, 1)), gaussian(mix(key, 2))};
}

}  // namespace

std::vector<ImuSample> imu_samples(const Scanner& scanner, std::uint64_t seed, double stamp_s, double from_s,
                                   double to_s) {
  constexpr double kHalf_s = 0.5 * Imu::kStep_s;
  const std::uint64_t key = mix(seed, 0x1a11);
  const Eigen::Vector3f gyro_bias = Imu::kGyroBias_radps * noise(mix(key, 1)),
                        acceleration_bias = Imu::kAccelerationBias_mps2 * noise(mix(key, 2));
  std::vector<ImuSample> samples;
  for (auto k = static_cast<std::int64_t>(std::ceil(from_s / Imu::kStep_s));
       static_cast<double>(k) * Imu::kStep_s <= to_s; ++k) {
    const double time_s = static_cast<double>(k) * Imu::kStep_s;
    const Pose T_before = scanner.T_world_lidar(time_s - kHalf_s), T_here = scanner.T_world_lidar(time_s),
               T_after = scanner.T_world_lidar(time_s + kHalf_s);
    const Eigen::Vector3d acceleration =
        (T_after.translation() - 2.0 * T_here.translation() + T_before.translation()) / (kHalf_s * kHalf_s);
    const Eigen::Vector3d felt =
        T_here.linear().transpose() * (acceleration + Imu::kGravity_mps2 * Eigen::Vector3d::UnitZ());
    ImuSample sample;
    sample.time_s = time_s - stamp_s;
    sample.angular_radps = twist_of(T_before.inverse() * T_after, Imu::kStep_s).angular_radps.cast<float>() +
                           gyro_bias + Imu::kGyroNoise_radps * noise(mix(key, 3, as_key(k)));
    sample.acceleration_mps2 =
        felt.cast<float>() + acceleration_bias + Imu::kAccelerationNoise_mps2 * noise(mix(key, 4, as_key(k)));
    samples.push_back(sample);
  }
  return samples;
}

}  // namespace revisit::simulation_internal
