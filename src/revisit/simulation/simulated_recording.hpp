// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include <revisit/config/parameters.hpp>
#include <revisit/core/image.hpp>
#include <revisit/io/recording.hpp>
#include <revisit/simulation/sensor_model.hpp>

namespace revisit {

enum class ImageLight : std::uint8_t { kDay, kNight };

/// A recording that exists nowhere: each scan is computed when it is read. World: x, y level, z up, metres; stamps
/// count from the start of the drive, and a scan's stamp is the middle of its sweep, where the sensor looks straight
/// ahead. The same options give the same bytes for any number of threads. Reading is safe from several threads.
class SimulatedRecording final : public Recording {
 public:
  ~SimulatedRecording() override;

  std::size_t size() const override;
  FrameId frame(std::size_t index) const override;
  double stamp_s(std::size_t index) const override;
  Result<Scan> read(std::size_t index) const override;
  std::string kind() const override;
  bool has_times() const override { return true; }
  /// The exact poses of the sensor at the stamps.
  const Trajectory& trajectory() const override;
  /// KITTI's axes: x right, y down, z forward; the camera sits in the LiDAR.
  std::optional<Pose> T_camera_lidar() const override;

  const SimulationOptions& options() const;
  const SensorModel& sensor() const;
  /// Flat, from the first pose on, with slip and a wrong scale.
  const Trajectory& wheel_odometry() const;
  bool has_wheel_odometry() const override { return true; }
  std::optional<Pose> wheel_pose(std::size_t index) const override { return wheel_odometry().at(frame(index)); }
  /// Five a second, where there is a receiver.
  Result<std::vector<GpsFix>> gps_fixes(const std::string& topic) const override;
  /// What an IMU in the sensor reads in this part of the drive; times from `stamp_s`.
  std::vector<ImuSample> imu(double stamp_s, double from_s, double to_s) const;
  /// What a camera in the LiDAR, which looks ahead, sees at the stamp of scan `index`: 640 x 240 pixels, 90 degrees
  /// wide, in the light of the day or by the vehicle's own lamp.
  Image image(std::size_t index, ImageLight light = ImageLight::kDay) const;
  /// Six degrees of freedom, drifting away slowly.
  const Trajectory& drifting_odometry() const;

 private:
  friend Result<std::unique_ptr<SimulatedRecording>> simulate(const SimulationOptions&, const LogSink&, int);
  struct Parts;
  explicit SimulatedRecording(std::unique_ptr<Parts> parts);
  std::unique_ptr<Parts> parts_;
};

/// Builds the world and its drive. `threads` work on a scan; 0: all there are. Errors: an unknown world or sensor, a
/// trajectory that cannot be driven (one pose, NaN, jumps).
Result<std::unique_ptr<SimulatedRecording>> simulate(const SimulationOptions& options, const LogSink& log = {},
                                                     int threads = 0);

}  // namespace revisit
