// SPDX-License-Identifier: Apache-2.0
#include <charconv>
#include <cmath>

#include <revisit/io/internal/bytes.hpp>
#include <revisit/io/internal/kitti_folder.hpp>

namespace revisit::io_internal {
namespace {

constexpr double kEarthRadius_m = 6378137.0;

// KITTI raw's convention: Mercator scaled by the latitude of the first row; roll, pitch, yaw about x, y, z.
Pose mercator_pose(const double* row, double scale) {
  const double latitude_deg = row[0], longitude_deg = row[1], altitude_m = row[2];
  Pose T = Pose::Identity();
  T.translation() << scale * to_radians(longitude_deg) * kEarthRadius_m,
      scale * kEarthRadius_m * std::log(std::tan(to_radians(90.0 + latitude_deg) / 2.0)), altitude_m;
  T.linear() =
      (Eigen::AngleAxisd(row[5], Eigen::Vector3d::UnitZ()) * Eigen::AngleAxisd(row[4], Eigen::Vector3d::UnitY()) *
       Eigen::AngleAxisd(row[3], Eigen::Vector3d::UnitX()))
          .toRotationMatrix();
  return T;
}

// Column 23 (dataformat.txt of the drives) is the position accuracy, north and east.
GpsFix fix_of_row(const std::vector<double>& row) {
  constexpr std::size_t kAccuracy = 23;
  GpsFix fix{0.0, row[0], row[1], row[2]};
  if (row.size() > kAccuracy && row[kAccuracy] > 0.0)
    fix.deviation_m = {row[kAccuracy], row[kAccuracy], 2.0 * row[kAccuracy]};
  return fix;
}

}  // namespace

GpsFix Oxts::fix_of(const Eigen::Vector3d& sensor_in_imu_m) const {
  const Eigen::Vector3d east_north_up_m = T_world_imu.linear() * sensor_in_imu_m;
  GpsFix moved = fix;
  moved.latitude_deg += to_degrees(east_north_up_m.y() / kEarthRadius_m);
  moved.longitude_deg += to_degrees(east_north_up_m.x() / (kEarthRadius_m * std::cos(to_radians(fix.latitude_deg))));
  moved.altitude_m += east_north_up_m.z();
  return moved;
}

Result<std::map<FrameId, Oxts>> read_oxts(const std::filesystem::path& folder) {
  std::map<FrameId, std::vector<double>> rows;
  std::error_code failure;
  for (std::filesystem::directory_iterator it(folder / "data", failure), end; !failure && it != end;
       it.increment(failure)) {
    const std::string stem = it->path().stem().string();
    std::int64_t number = 0;
    const auto parsed = std::from_chars(stem.data(), stem.data() + stem.size(), number);
    if (it->path().extension() != ".txt" || parsed.ptr != stem.data() + stem.size() || stem.empty()) continue;
    auto file_rows = read_number_rows(it->path());
    if (!file_rows) return file_rows.error();
    constexpr std::size_t kNeeded = 6;  // latitude, longitude, altitude, roll, pitch, yaw
    if (file_rows->size() != 1 || (*file_rows)[0].values.size() < kNeeded)
      return Error{it->path().string() + ": one row of at least 6 numbers is needed"};
    rows[FrameId{number}] = std::move((*file_rows)[0].values);
  }
  if (failure) return Error{(folder / "data").string() + ": cannot be read: " + failure.message()};
  std::map<FrameId, Oxts> poses;
  if (rows.empty()) return poses;
  const double scale = std::cos(to_radians(rows.begin()->second[0]));
  for (const auto& [frame, row] : rows) {
    const Pose T = mercator_pose(row.data(), scale);
    if (!T.matrix().allFinite())
      return Error{(folder / "data").string() + ": row of frame " + std::to_string(frame.value) + " is no pose"};
    poses[frame] = {T, fix_of_row(row)};
  }
  return poses;
}

}  // namespace revisit::io_internal
