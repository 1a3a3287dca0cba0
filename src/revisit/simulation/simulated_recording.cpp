// SPDX-License-Identifier: Apache-2.0
#include <revisit/simulation/simulated_recording.hpp>

#include <algorithm>
#include <mutex>
#include <stdexcept>

#include <revisit/simulation/internal/camera.hpp>
#include <revisit/simulation/internal/gps_model.hpp>
#include <revisit/simulation/internal/imu_model.hpp>
#include <revisit/simulation/internal/odometry_model.hpp>
#include <revisit/simulation/internal/scanner.hpp>

namespace revisit {

using simulation_internal::Path;
using simulation_internal::Scanner;
using simulation_internal::World;

struct SimulatedRecording::Parts {
  SimulationOptions options;
  SensorModel sensor;
  World world;
  std::size_t size;
  std::unique_ptr<Scanner> scanner;
  Trajectory truth, wheels, drifting;
  std::once_flag has_camera = {};
  std::unique_ptr<simulation_internal::Camera> camera = {};  ///< made for the first image
};

SimulatedRecording::SimulatedRecording(std::unique_ptr<Parts> parts) : parts_(std::move(parts)) {}
SimulatedRecording::~SimulatedRecording() = default;

std::size_t SimulatedRecording::size() const { return parts_->size; }
FrameId SimulatedRecording::frame(std::size_t index) const { return FrameId{static_cast<std::int64_t>(index)}; }
double SimulatedRecording::stamp_s(std::size_t index) const { return Path::kStep_s * static_cast<double>(index); }
std::string SimulatedRecording::kind() const {
  return "simulated " + parts_->options.world + ", " + parts_->sensor.title + ", seed " +
         std::to_string(parts_->options.seed) +
         (parts_->options.day == 0 ? std::string() : ", day " + std::to_string(parts_->options.day));
}
const Trajectory& SimulatedRecording::trajectory() const { return parts_->truth; }
Result<std::vector<GpsFix>> SimulatedRecording::gps_fixes(const std::string&) const {
  if (!parts_->options.gps) return std::vector<GpsFix>();
  return simulation_internal::gps_fixes(parts_->truth, parts_->options.difficulty, parts_->world.seed_of_day());
}

const Trajectory& SimulatedRecording::wheel_odometry() const { return parts_->wheels; }
const Trajectory& SimulatedRecording::drifting_odometry() const { return parts_->drifting; }
const SimulationOptions& SimulatedRecording::options() const { return parts_->options; }
const SensorModel& SimulatedRecording::sensor() const { return parts_->sensor; }

std::optional<Pose> SimulatedRecording::T_camera_lidar() const {
  Pose T = Pose::Identity();
  T.linear() << 0, -1, 0, 0, 0, -1, 1, 0, 0;
  return T;
}

Result<Scan> SimulatedRecording::read(std::size_t index) const {
  if (index >= size()) throw std::out_of_range("scan " + std::to_string(index) + " of " + std::to_string(size()));
  Scan scan = parts_->scanner->sweep(static_cast<std::int64_t>(index), stamp_s(index));
  // Since the sweep before, and to the end of this one.
  if (parts_->options.imu) scan.imu = imu(stamp_s(index), stamp_s(index) - 0.2, stamp_s(index) + 0.05);
  return scan;
}

std::vector<ImuSample> SimulatedRecording::imu(double stamp_s, double from_s, double to_s) const {
  return simulation_internal::imu_samples(*parts_->scanner, parts_->world.seed_of_day(), stamp_s, from_s, to_s);
}

Image SimulatedRecording::image(std::size_t index, ImageLight light) const {
  if (index >= size()) throw std::out_of_range("image " + std::to_string(index) + " of " + std::to_string(size()));
  std::call_once(parts_->has_camera,
                 [this] { parts_->camera = std::make_unique<simulation_internal::Camera>(parts_->world); });
  Pose T_local_lidar = parts_->scanner->T_world_lidar(stamp_s(index));
  T_local_lidar.translation() -= parts_->world.origin;
  return parts_->camera->picture(
      T_local_lidar, stamp_s(index), light,
      simulation_internal::mix(parts_->world.seed_of_day(), 81, static_cast<std::uint64_t>(index)));
}

Result<std::unique_ptr<SimulatedRecording>> simulate(const SimulationOptions& options, const LogSink& log,
                                                     int threads) {
  const auto sensor = find_sensor_model(options.sensor);
  if (!sensor) return sensor.error();
  if (options.world != "town" && options.world != "warehouse" && options.world != "building")
    return Error{"simulation.world = '" + options.world + "' is not known; allowed: town, warehouse, building"};
  auto world = options.world == "town"        ? simulation_internal::build_town(options, log)
               : options.world == "warehouse" ? simulation_internal::build_warehouse(options)
                                              : simulation_internal::build_building(options);
  if (!world) return world.error();

  auto parts = std::unique_ptr<SimulatedRecording::Parts>(
      new SimulatedRecording::Parts{options, *sensor, *std::move(world), 0, nullptr, {}, {}, {}});
  parts->size = parts->world.path.knots().size();
  if (options.frames > 0) parts->size = std::min(parts->size, static_cast<std::size_t>(options.frames));
  parts->scanner = std::make_unique<Scanner>(
      parts->world, *sensor,
      Scanner::Options{options.tilt_deg, options.blind_deg, options.motion_distortion, threads, ""});
  for (std::size_t i = 0; i < parts->size; ++i) {
    const double stamp_s = Path::kStep_s * static_cast<double>(i);
    parts->truth.entries[FrameId{static_cast<std::int64_t>(i)}] = {stamp_s, parts->scanner->T_world_lidar(stamp_s)};
  }
  parts->wheels = simulation_internal::wheel_odometry(parts->truth, parts->world.seed_of_day());
  parts->drifting = simulation_internal::drifting_odometry(parts->truth, parts->world.seed_of_day());
  return std::unique_ptr<SimulatedRecording>(new SimulatedRecording(std::move(parts)));
}

}  // namespace revisit
