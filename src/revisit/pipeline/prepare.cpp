// SPDX-License-Identifier: Apache-2.0
#include <revisit/pipeline/prepare.hpp>

#include <utility>
#include <vector>

#include <oneapi/tbb/parallel_invoke.h>

#include <revisit/core/stopwatch.hpp>
#include <revisit/preprocess/imu_track.hpp>
#include <revisit/preprocess/range_filter.hpp>
#include <revisit/preprocess/rings.hpp>
#include <revisit/preprocess/undistort.hpp>
#include <revisit/preprocess/upright.hpp>
#include <revisit/verification/geometric.hpp>

namespace revisit {
namespace {

Error describes_no_place(const PreparedScan& prepared) {
  return {"frame " + std::to_string(prepared.scan.frame.value) + ": " + std::to_string(prepared.scan.points.size()) +
          " usable points occupy " + std::to_string(prepared.descriptor.occupied_cells()) + " of " +
          std::to_string(prepared.descriptor.image_cells()) + " cells; at least " +
          std::to_string(LayerConstants::kFewestCells) + " are needed to describe a place"};
}

}  // namespace

Result<PreparedScan> prepare_scan(Scan scan, const Parameters& parameters, const IntensityScale& scale,
                                  const IntensityCalibration& calibration, const std::optional<Twist>& motion) {
  PreparedScan prepared;
  prepared.scan = std::move(scan);
  std::vector<Point>& points = prepared.scan.points;
  Stopwatch watch;
  filter_range(prepared.scan, parameters.preprocess);
  prepared.ms.filter = watch.lap_ms();

  Rings rings;
  Eigen::Vector3f up;
  const auto find_own_up = [&] { up = prepared.scan.up ? unless_level(*prepared.scan.up) : find_up(points); };
  tbb::parallel_invoke([&] { rings = find_rings(prepared.scan); }, find_own_up);
  if (up.z() < 0.f) turn_over(rings);
  const Pose T_upright_lidar = upright_pose(up);
  rotate(points, T_upright_lidar);
  prepared.ground = segment_ground(prepared.scan, rings, parameters.preprocess);
  prepared.ms.ground = watch.lap_ms();

  // Ring gains fit only the sensor that they were learnt with.
  const bool rings_fit = rings.count() == calibration.ring_gains.size();
  normalise_intensity(prepared.scan, scale, calibration,
                      rings_fit ? std::span<const std::uint16_t>(rings.of_point) : std::span<const std::uint16_t>());
  if (motion) undistort(prepared.scan, rotated(*motion, T_upright_lidar));
  prepared.ms.intensity = watch.lap_ms();

  prepared.ground_z_m = ground_height_m(points, prepared.ground.is_ground);
  prepared.descriptor =
      parameters.preprocess.remove_ground
          ? describe(above_ground(points, prepared.ground.is_ground), parameters.descriptor, prepared.ground_z_m)
          : describe(points, parameters.descriptor, prepared.ground_z_m);
  prepared.ms.describe = watch.lap_ms();
  if (prepared.descriptor.occupied_cells() < LayerConstants::kFewestCells) return describes_no_place(prepared);

  rotate(points, T_upright_lidar.inverse());
  prepared.cloud = thin_for_registration(points, prepared.ground.is_ground);
  prepared.cloud.up = up;
  prepared.ms.thin = watch.lap_ms();
  return prepared;
}

ScanPreparation::ScanPreparation(const Parameters& parameters, const std::optional<IntensityScale>& scale,
                                 IntensityCalibration calibration, LogSink log)
    : parameters_(parameters),
      scale_(parameters.intensity),
      calibration_(std::move(calibration)),
      log_(std::move(log)) {
  if (scale) {
    scale_.set(*scale);
    reported_warning_ = scale->warning;  // who gave the scale knows
  }
}

Result<PreparedScan> ScanPreparation::prepare(Scan scan, const std::optional<Twist>& motion) {
  require_consistent(scan);
  if (!scan.up && !scan.imu.empty()) {  // nobody followed the sensor: by the readings of this scan alone
    ImuTrack imu;
    imu.add(scan);
    scan.up = imu.up();
  }
  if (!scale_.is_settled()) {
    filter_range(scan, parameters_.preprocess);
    scale_.add(scan);
    if (const std::string& warning = scale_.scale().warning; !warning.empty() && warning != reported_warning_)
      log_to(log_, LogLevel::kWarning, warning);
    reported_warning_ = scale_.scale().warning;
  }
  auto prepared = prepare_scan(std::move(scan), parameters_, scale_.scale(), calibration_, motion);
  if (prepared && !std::exchange(has_reported_rings_, true)) report(prepared->ground);
  return prepared;
}

void ScanPreparation::report(const GroundSegmentation& ground) {
  const std::size_t known = calibration_.ring_gains.size(), seen = ground.ring_count;
  if (known != 0 && known != seen)
    log_to(log_, LogLevel::kWarning,
           "the intensity calibration knows " + std::to_string(known) + " laser rings, the scans show " +
               std::to_string(seen) + ": its ring gains are left out (was it made with another sensor?)");
  if (ground.rings == RingSource::kNone)
    log_to(log_, LogLevel::kWarning,
           "no laser rings found: ground is segmented on a polar grid instead of the range image");
  else
    log_to(log_, LogLevel::kInfo, std::to_string(seen) + " laser rings, " + to_string(ground.rings));
}

}  // namespace revisit
