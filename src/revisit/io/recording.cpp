// SPDX-License-Identifier: Apache-2.0
#include <revisit/io/recording.hpp>

#include <algorithm>
#include <charconv>
#include <iomanip>

#include <revisit/io/internal/kitti_folder.hpp>
#include <revisit/io/internal/text_writer.hpp>
#include <revisit/io/pose_file.hpp>
#include <revisit/io/scan_file.hpp>

namespace revisit {
namespace {

namespace fs = std::filesystem;

struct ScanFile {
  FrameId frame;
  fs::path file;
  double stamp_s = 0.0;
};

class FolderRecording final : public Recording {
 public:
  std::string kind_;
  std::vector<ScanFile> scans_;
  bool has_times_ = false;
  Trajectory trajectory_, wheel_odometry_;
  std::optional<Pose> T_camera_lidar_;
  fs::path point_values_;  // where times and rings of points may stand
  LogSink log_;

  std::size_t size() const override { return scans_.size(); }
  FrameId frame(std::size_t index) const override { return scans_.at(index).frame; }
  double stamp_s(std::size_t index) const override { return scans_.at(index).stamp_s; }
  std::string kind() const override { return kind_; }
  bool has_times() const override { return has_times_; }
  const Trajectory& trajectory() const override { return trajectory_; }
  const Trajectory& wheel_odometry() const override { return wheel_odometry_; }
  std::optional<Pose> T_camera_lidar() const override { return T_camera_lidar_; }

  Result<Scan> read(std::size_t index) const override {
    auto scan = read_scan(scans_.at(index).file, log_);
    if (!scan) return scan;
    if (!point_values_.empty())
      if (const Status status = io_internal::read_point_values(point_values_, scans_[index].file.filename(), *scan);
          !status)
        return status.error();
    scan->frame = scans_[index].frame;
    scan->stamp_s = scans_[index].stamp_s;
    return scan;
  }

  // Poses of frames that the recording does not hold are left out.
  Trajectory of_scans(const PoseFile& poses) const {
    std::vector<std::pair<FrameId, double>> stamps;
    for (const ScanFile& scan : scans_) stamps.emplace_back(scan.frame, scan.stamp_s);
    const Trajectory all = to_trajectory(poses, T_camera_lidar_, stamps);
    Trajectory present;
    for (const ScanFile& scan : scans_)
      if (const auto found = all.entries.find(scan.frame); found != all.entries.end()) present.entries.insert(*found);
    return present;
  }
};

// The last group of digits in the name before its extensions: "scan_000123.pcd" -> 123, "42.pcd.bin" -> 42.
std::optional<std::int64_t> number_in_name(const fs::path& file) {
  const std::string name = file.filename().string();
  const std::string stem = name.substr(0, name.find('.'));
  const auto last = stem.find_last_of("0123456789");
  if (last == std::string::npos) return std::nullopt;
  const auto before = stem.find_last_not_of("0123456789", last);
  const std::size_t first = before == std::string::npos ? 0 : before + 1;
  std::int64_t number = 0;
  const auto parsed = std::from_chars(stem.data() + first, stem.data() + last + 1, number);
  if (parsed.ec != std::errc()) return std::nullopt;
  return number;
}

// Whether something stands there. What cannot even be looked at (permissions, links in circles) counts as there:
// reading it then gives the system's reason.
bool is_present(const fs::path& path) {
  std::error_code failure;
  return fs::status(path, failure).type() != fs::file_type::not_found;
}

// Names of 13 digits and more are times since 1970 in milli-, micro- or nanoseconds (NCLT, ROS): seconds a unit.
std::optional<double> unit_of_time_in_names(const std::map<FrameId, fs::path>& by_number) {
  const double first = static_cast<double>(by_number.begin()->first.value);
  for (const double unit_s : {1e-3, 1e-6, 1e-9})
    if (first * unit_s > 3e8 && first * unit_s < 1e10) return unit_s;  // 1979 to 2286
  return std::nullopt;
}

// Frame numbers come from the names; where those are times, or do not tell the files apart, from the order.
Status list_scans(const fs::path& folder, FolderRecording& recording) {
  std::vector<fs::path> files;
  std::error_code failure;
  for (fs::directory_iterator it(folder, failure), end; !failure && it != end; it.increment(failure))
    if (has_scan_extension(it->path())) files.push_back(it->path());
  if (failure) return Error{folder.string() + ": cannot be read: " + failure.message()};
  if (files.empty()) return Error{folder.string() + ": holds no scan (.bin, .pcd, .ply)"};
  std::sort(files.begin(), files.end());
  std::map<FrameId, fs::path> by_number;
  for (const fs::path& file : files)
    if (const auto number = number_in_name(file)) by_number.emplace(FrameId{*number}, file);
  auto& scans = recording.scans_;
  if (by_number.size() != files.size()) {
    for (const fs::path& file : files) scans.push_back({FrameId{static_cast<std::int64_t>(scans.size())}, file, 0.0});
  } else if (const auto unit_s = unit_of_time_in_names(by_number)) {
    for (const auto& [number, file] : by_number)
      scans.push_back(
          {FrameId{static_cast<std::int64_t>(scans.size())}, file, static_cast<double>(number.value) * *unit_s});
    recording.has_times_ = true;
    return ok();
  } else {
    for (const auto& [frame, file] : by_number) scans.push_back({frame, file, 0.0});
  }
  for (ScanFile& scan : scans) scan.stamp_s = 0.1 * static_cast<double>(scan.frame.value);
  return ok();
}

// Rows of times are counted by frame number.
Status set_stamps(FolderRecording& recording, const fs::path& file, const Result<std::vector<double>>& times) {
  if (!times) return times.error();
  for (ScanFile& scan : recording.scans_) {
    if (static_cast<std::size_t>(scan.frame.value) >= times->size())
      return Error{file.string() + ": " + std::to_string(times->size()) + " rows, but frame " +
                   std::to_string(scan.frame.value) + " needs row " + std::to_string(scan.frame.value + 1)};
    scan.stamp_s = (*times)[static_cast<std::size_t>(scan.frame.value)];
  }
  recording.has_times_ = true;
  return ok();
}

Status add_kitti_odometry(FolderRecording& recording, const fs::path& folder) {
  recording.kind_ = "KITTI odometry folder";
  recording.point_values_ = folder;
  if (const auto file = folder / "times.txt"; is_present(file))
    if (const Status status = set_stamps(recording, file, io_internal::read_times(file)); !status) return status;
  if (const auto file = folder / "calib.txt"; is_present(file)) {
    const auto Tr = io_internal::read_kitti_calibration(file, "Tr");
    if (!Tr) return Tr.error();
    recording.T_camera_lidar_ = *Tr;
  }
  for (const char* name : {"poses.txt", "poses_subset.txt"}) {
    const fs::path file = folder / name;
    if (!is_present(file)) continue;
    const auto poses = read_poses(file);
    if (!poses) return poses.error();
    recording.trajectory_ = recording.of_scans(*poses);
    break;
  }
  return ok();
}

Status add_kitti_raw(FolderRecording& recording, const fs::path& folder) {
  recording.kind_ = "KITTI raw drive";
  if (const auto file = folder / "velodyne_points" / "timestamps.txt"; is_present(file))
    if (const Status status = set_stamps(recording, file, io_internal::read_timestamps(file)); !status) return status;
  if (!is_present(folder / "oxts" / "data")) return ok();
  const auto imu_poses = io_internal::read_oxts(folder / "oxts");
  if (!imu_poses) return imu_poses.error();
  Pose T_lidar_imu = Pose::Identity();
  // KITTI keeps the calibration beside the drives of a day.
  const fs::path beside = folder / "calib_imu_to_velo.txt", above = folder / ".." / "calib_imu_to_velo.txt";
  if (const auto& file = is_present(beside) ? beside : above; is_present(file)) {
    const auto calibration = io_internal::read_kitti_raw_calibration(file);
    if (!calibration) return calibration.error();
    T_lidar_imu = *calibration;
  } else {
    log_to(recording.log_, LogLevel::kWarning,
           beside.string() + ": missing, and the IMU's poses are not the LiDAR's: they are left out");
    return ok();
  }
  if (imu_poses->empty()) return ok();
  const Pose T_first_world = (imu_poses->begin()->second * T_lidar_imu.inverse()).inverse();
  for (const ScanFile& scan : recording.scans_) {
    const auto found = imu_poses->find(scan.frame);
    if (found == imu_poses->end()) continue;
    recording.trajectory_.entries[scan.frame] = {scan.stamp_s, T_first_world * found->second * T_lidar_imu.inverse()};
  }
  return ok();
}

}  // namespace

Result<std::unique_ptr<Recording>> open_recording(const fs::path& folder, const LogSink& log,
                                                  const fs::path& poses_file) {
  std::error_code failure;
  const fs::file_status status = fs::status(folder, failure);
  if (status.type() == fs::file_type::not_found) return Error{folder.string() + ": no such folder"};
  if (failure) return Error{folder.string() + ": cannot be read: " + failure.message()};
  if (!fs::is_directory(status)) return Error{folder.string() + ": is not a folder of scans"};

  const fs::path raw = folder / "velodyne_points" / "data", odometry = folder / "velodyne";
  const bool is_raw = fs::is_directory(raw, failure), is_odometry = fs::is_directory(odometry, failure);
  auto recording = std::make_unique<FolderRecording>();
  recording->log_ = log;
  recording->kind_ = "folder of scans";
  if (const Status listed = list_scans(is_raw ? raw : is_odometry ? odometry : folder, *recording); !listed)
    return listed.error();
  if (const Status added = is_raw        ? add_kitti_raw(*recording, folder)
                           : is_odometry ? add_kitti_odometry(*recording, folder)
                                         : ok();
      !added)
    return added.error();
  if (const fs::path wheels = folder / "wheel_odometry.tum"; is_present(wheels)) {
    const auto poses = read_poses(wheels);
    if (!poses) return poses.error();
    recording->wheel_odometry_ = recording->of_scans(*poses);
  }
  if (!poses_file.empty()) {
    const auto poses = read_poses(poses_file);
    if (!poses) return poses.error();
    recording->trajectory_ = recording->of_scans(*poses);
    if (recording->trajectory_.empty())
      return Error{poses_file.string() + ": no pose belongs to a frame of " + folder.string()};
  }
  return std::unique_ptr<Recording>(std::move(recording));
}

Result<Pose> read_camera_calibration(const fs::path& file) { return io_internal::read_kitti_calibration(file, "Tr"); }

Status write_camera_calibration(const fs::path& file, const Pose& T_camera_lidar) {
  io_internal::TextWriter writer(file);
  writer.stream() << "Tr:" << std::setprecision(12);
  for (int i = 0; i < 12; ++i) writer.stream() << ' ' << T_camera_lidar.matrix()(i / 4, i % 4);
  writer.stream() << '\n';
  return writer.finish();
}

}  // namespace revisit
