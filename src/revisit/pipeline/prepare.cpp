// SPDX-License-Identifier: Apache-2.0
#include <revisit/pipeline/prepare.hpp>

#include <algorithm>
#include <chrono>

#include <oneapi/tbb/parallel_invoke.h>

#include <revisit/preprocess/range_filter.hpp>
#include <revisit/preprocess/rings.hpp>
#include <revisit/preprocess/undistort.hpp>
#include <revisit/preprocess/upright.hpp>

namespace revisit {
namespace {

double now_ms() {
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

std::vector<Point> above_ground(const Scan& scan, const std::vector<std::uint8_t>& is_ground) {
  std::vector<Point> points;
  points.reserve(scan.points.size());
  for (std::size_t i = 0; i < scan.points.size(); ++i)
    if (is_ground[i] == 0) points.push_back(scan.points[i]);
  return points;
}

}  // namespace

Stopwatch::Stopwatch() : last_ms_(now_ms()) {}

double Stopwatch::lap_ms() {
  const double now = now_ms(), lap = now - last_ms_;
  last_ms_ = now;
  return lap;
}

namespace {

// About the sensor; those of an upright one are not touched.
void turn(std::span<Point> points, const Pose& T) {
  const Eigen::Matrix3f R = T.linear().cast<float>();
  if (R.isIdentity(0.f)) return;
  for (Point& p : points) {
    const Eigen::Vector3f q = R * Eigen::Vector3f(p.x, p.y, p.z);
    p = {q.x(), q.y(), q.z(), p.intensity};
  }
}

Twist turned(const Twist& motion, const Pose& T) {
  return {T.linear() * motion.linear_mps, T.linear() * motion.angular_radps};
}

// The middle of the heights of the ground nearby; where there is none, that of a sensor on a car.
double ground_below_sensor_m(std::span<const Point> points, std::span<const std::uint8_t> is_ground) {
  constexpr float kNearby_m = 15.f;
  constexpr std::size_t kFewest = 50;
  std::vector<float> heights;
  for (std::size_t i = 0; i < points.size(); ++i)
    if (is_ground[i] != 0 && points[i].x * points[i].x + points[i].y * points[i].y < kNearby_m * kNearby_m)
      heights.push_back(points[i].z);
  if (heights.size() < kFewest) return kGroundBelowCarSensor_m;
  const auto middle = heights.begin() + static_cast<std::ptrdiff_t>(heights.size() / 2);
  std::nth_element(heights.begin(), middle, heights.end());
  return static_cast<double>(*middle);
}

}  // namespace

Result<PreparedScan> prepare_scan(Scan scan, const Parameters& parameters, const IntensityScale& scale,
                                  const IntensityCalibration& calibration, const std::optional<Twist>& motion) {
  require_consistent(scan);
  PreparedScan prepared;
  prepared.scan = std::move(scan);
  Stopwatch watch;
  filter_range(prepared.scan, parameters.preprocess);
  prepared.ms.filter = watch.lap_ms();

  Rings rings;
  Eigen::Vector3f up;
  tbb::parallel_invoke([&] { rings = find_rings(prepared.scan); }, [&] { up = find_up(prepared.scan.points); });
  const Pose T_upright_lidar = upright_pose(up);
  turn(prepared.scan.points, T_upright_lidar);
  prepared.ground = segment_ground(prepared.scan, rings, parameters.preprocess);
  prepared.ms.ground = watch.lap_ms();

  // Ring gains fit only the sensor that they were learnt with.
  const bool rings_fit = rings.count() == calibration.ring_gains.size();
  normalise_intensity(prepared.scan, scale, calibration,
                      rings_fit ? std::span<const std::uint16_t>(rings.of_point) : std::span<const std::uint16_t>());
  if (motion) undistort(prepared.scan, turned(*motion, T_upright_lidar));
  prepared.ms.intensity = watch.lap_ms();

  prepared.ground_z_m = ground_below_sensor_m(prepared.scan.points, prepared.ground.is_ground);
  std::vector<Point> standing;
  std::span<const Point> described = prepared.scan.points;
  if (parameters.preprocess.remove_ground)
    described = standing = above_ground(prepared.scan, prepared.ground.is_ground);
  prepared.descriptor = describe(described, parameters.descriptor, prepared.ground_z_m);
  prepared.ms.describe = watch.lap_ms();
  if (prepared.descriptor.occupied_cells() < parameters.descriptor.min_occupied_cells)
    return Error{"frame " + std::to_string(prepared.scan.frame.value) + ": " +
                 std::to_string(prepared.scan.points.size()) + " usable points occupy " +
                 std::to_string(prepared.descriptor.occupied_cells()) + " of " +
                 std::to_string(prepared.descriptor.image_cells()) + " cells; at least " +
                 std::to_string(parameters.descriptor.min_occupied_cells) + " are needed to describe a place"};

  turn(prepared.scan.points, T_upright_lidar.inverse());
  prepared.cloud = thin(prepared.scan.points, prepared.ground.is_ground, parameters.geometric.voxel_m);
  prepared.cloud.up = up;
  prepared.ms.thin = watch.lap_ms();
  return prepared;
}

Result<IntensityScale> estimate_intensity_scale(const Recording& recording, const Parameters& parameters) {
  constexpr std::size_t kSamples = 10;
  std::vector<Scan> sample;
  std::optional<Error> first_error;
  const std::size_t count = std::min(kSamples, recording.size());
  // The first readable scan of each tenth of the recording: broken ones must not decide.
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t begin = i * recording.size() / count, end = (i + 1) * recording.size() / count;
    for (std::size_t index = begin; index < end; ++index) {
      auto scan = recording.read(index);
      if (scan) {
        sample.push_back(*std::move(scan));
        break;
      }
      if (!first_error) first_error = scan.error();
    }
  }
  if (sample.empty()) return first_error.value_or(Error{"the recording holds no scan"});
  return estimate_intensity_scale(std::span<const Scan>(sample), parameters.intensity);
}

}  // namespace revisit
