// SPDX-License-Identifier: Apache-2.0
#include <revisit/io/recording.hpp>

#include <algorithm>
#include <charconv>
#include <iomanip>

#include <revisit/io/internal/bag.hpp>
#include <revisit/io/internal/bag_recording.hpp>
#include <revisit/io/internal/kitti_folder.hpp>
#include <revisit/io/internal/remarks.hpp>
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
  std::vector<GpsFix> gps_;
  std::optional<Pose> T_camera_lidar_;
  bool is_of_kitti_ = false;  // the car, not only the layout
  fs::path point_values_;     // where times and rings of points may stand
  std::shared_ptr<io_internal::Remarks> remarks_;

  std::size_t size() const override { return scans_.size(); }
  FrameId frame(std::size_t index) const override { return scans_.at(index).frame; }
  double stamp_s(std::size_t index) const override { return scans_.at(index).stamp_s; }
  std::string kind() const override { return kind_; }
  bool has_times() const override { return has_times_; }
  const Trajectory& trajectory() const override { return trajectory_; }
  bool has_wheel_odometry() const override { return !wheel_odometry_.empty(); }
  std::optional<Pose> wheel_pose(std::size_t index) const override { return wheel_odometry_.at(frame(index)); }
  std::optional<Pose> T_camera_lidar() const override { return T_camera_lidar_; }
  Result<std::vector<GpsFix>> gps_fixes(const std::string&) const override { return gps_; }
  // What published odometries correct it by; `revisit calibrate` finds 0.13 in 60 scans.
  double elevation_offset_deg() const override { return is_of_kitti_ ? 0.205 : 0.0; }

  Result<Scan> read(std::size_t index) const override {
    const fs::path& file = scans_.at(index).file;
    auto scan = read_scan(file, remarks_->about(file));
    if (!scan) return scan;
    if (!point_values_.empty())
      if (const Status status = io_internal::read_point_values(point_values_, file, *scan); !status)
        return status.error();
    scan->frame = scans_[index].frame;
    scan->stamp_s = scans_[index].stamp_s;
    scan->is_stamp_assumed = !has_times_;
    return scan;
  }

  // Poses of frames that the recording does not hold are left out.
  Trajectory of_scans(const PoseFile& poses) const {
    std::vector<FrameTime> stamps;
    for (const ScanFile& scan : scans_) stamps.push_back({scan.frame, scan.stamp_s});
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

// What `revisit slam` wrote holds a map.ply and a map.pcd, which are no scans.
bool is_map_folder(const fs::path& folder) {
  std::error_code failure;
  return fs::is_regular_file(folder / "tiles" / "tileset.json", failure) ||
         fs::is_regular_file(folder / "map.revisit", failure) || fs::is_regular_file(folder / "map.sqlite", failure);
}

// Names may be times: of 13 digits and more since 1970 in milli-, micro- or nanoseconds (NCLT, ROS), or since the
// sensor started, in micro- or nanoseconds, which their steps tell: frames are not counted in ten thousands. Seconds a
// unit.
std::optional<double> unit_of_time_in_names(const std::map<FrameId, fs::path>& by_number) {
  std::vector<std::int64_t> steps;
  for (auto it = by_number.begin(); std::next(it) != by_number.end(); ++it)
    steps.push_back(std::next(it)->first.value - it->first.value);
  const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
  if (!steps.empty()) std::nth_element(steps.begin(), middle, steps.end());
  const double step = steps.empty() ? 0.0 : static_cast<double>(*middle);
  constexpr double kLongestStep_s = 600.0;  // between two scans of a recording
  const double first = static_cast<double>(by_number.begin()->first.value);
  for (const double unit_s : {1e-3, 1e-6, 1e-9})
    if (first >= 1e12 && first * unit_s < 1e10 && step * unit_s < kLongestStep_s) return unit_s;  // until 2286
  constexpr double kLeastStep_us = 2e4, kLeastStep_ns = 1e7;  // 50 and 100 scans a second
  if (step >= kLeastStep_ns) return 1e-9;
  if (step >= kLeastStep_us) return 1e-6;
  return std::nullopt;
}

// Frame numbers come from the names; where those are times, or do not tell the files apart, from the order.
Status list_scans(const fs::path& folder, FolderRecording& recording) {
  if (is_map_folder(folder))
    return Error{folder.string() + ": holds a map of `revisit slam`, not the scans of a recording"};
  std::vector<fs::path> files;
  std::error_code failure;
  for (fs::directory_iterator it(folder, failure), end; !failure && it != end; it.increment(failure))
    if (has_scan_extension(it->path())) files.push_back(it->path());
  if (failure) return Error{folder.string() + ": cannot be read: " + failure.message()};
  if (files.empty()) return Error{folder.string() + ": holds no scan (.bin, .pcd, .ply, .las)"};
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

// The row of each scan in a file of `rows` rows: by frame number or, where the numbers go beyond the rows and there is
// a row a scan, in the order of the scans.
std::vector<std::size_t> rows_of(const std::vector<ScanFile>& scans, std::size_t rows) {
  const bool in_order = rows == scans.size() && static_cast<std::size_t>(scans.back().frame.value) >= rows;
  std::vector<std::size_t> result(scans.size());
  for (std::size_t i = 0; i < scans.size(); ++i)
    result[i] = in_order ? i : static_cast<std::size_t>(scans[i].frame.value);
  return result;
}

Status set_stamps(FolderRecording& recording, const fs::path& file, const Result<std::vector<double>>& times) {
  if (!times) return times.error();
  const std::vector<std::size_t> rows = rows_of(recording.scans_, times->size());
  for (std::size_t i = 0; i < rows.size(); ++i)
    if (rows[i] >= times->size())
      return Error{file.string() + ": " + std::to_string(times->size()) + " rows, but frame " +
                   std::to_string(recording.scans_[i].frame.value) + " needs row " + std::to_string(rows[i] + 1)};
  for (std::size_t i = 0; i < rows.size(); ++i) recording.scans_[i].stamp_s = (*times)[rows[i]];
  recording.has_times_ = true;
  return ok();
}

// times.txt, calib.txt and poses.txt of a folder of scans.
Status add_side_files(FolderRecording& recording, const fs::path& folder) {
  if (const fs::path file = folder / "times.txt"; is_present(file) && !recording.has_times_)
    if (const Status status = set_stamps(recording, file, io_internal::read_times(file)); !status) return status;
  if (const fs::path file = folder / "calib.txt"; is_present(file)) {
    const auto Tr = io_internal::read_kitti_calibration(file, "Tr");
    if (!Tr) return Tr.error();
    recording.T_camera_lidar_ = *Tr;
    recording.is_of_kitti_ = io_internal::is_calibration_of_kitti(file);
  }
  for (const char* name : {"poses.txt", "poses_subset.txt"}) {
    const fs::path file = folder / name;
    if (!is_present(file)) continue;
    auto poses = read_poses(file);
    if (!poses) return poses.error();
    const std::vector<std::size_t> rows = rows_of(recording.scans_, poses->rows.size());
    if (poses->format == PoseFormat::kKitti && rows.back() + 1 == poses->rows.size())
      for (std::size_t i = 0; i < rows.size(); ++i) poses->rows[rows[i]].frame = recording.scans_[i].frame;
    recording.trajectory_ = recording.of_scans(*poses);
    return ok();
  }
  return ok();
}

// In a folder of scans, or else beside it, where they may belong to something else.
Status find_side_files(FolderRecording& recording, const fs::path& folder) {
  const bool are_inside = is_present(folder / "times.txt") || is_present(folder / "poses.txt");
  if (are_inside) return add_side_files(recording, folder);
  const fs::path beside = fs::absolute(folder / "..").lexically_normal();
  const Status status = add_side_files(recording, beside);
  if (!status)
    log_to(recording.remarks_->log(), LogLevel::kWarning, status.error().message + "; what stands beside is left out");
  return ok();
}

Status add_kitti_odometry(FolderRecording& recording, const fs::path& folder) {
  recording.kind_ = "KITTI odometry folder";
  recording.point_values_ = folder;
  return add_side_files(recording, folder);
}

Status add_kitti_raw(FolderRecording& recording, const fs::path& folder) {
  recording.kind_ = "KITTI raw drive";
  for (const fs::path& file : {folder / "calib_cam_to_cam.txt", folder / ".." / "calib_cam_to_cam.txt"})
    if (is_present(file)) recording.is_of_kitti_ = io_internal::is_calibration_of_kitti(file);
  if (const auto file = folder / "velodyne_points" / "timestamps.txt"; is_present(file))
    if (const Status status = set_stamps(recording, file, io_internal::read_timestamps(file)); !status) return status;
  if (!is_present(folder / "oxts" / "data")) return ok();
  const auto oxts = io_internal::read_oxts(folder / "oxts");
  if (!oxts) return oxts.error();
  Pose T_lidar_imu = Pose::Identity();
  // KITTI keeps the calibration beside the drives of a day.
  const fs::path beside = folder / "calib_imu_to_velo.txt", above = folder / ".." / "calib_imu_to_velo.txt";
  if (const auto& file = is_present(beside) ? beside : above; is_present(file)) {
    const auto calibration = io_internal::read_kitti_raw_calibration(file);
    if (!calibration) return calibration.error();
    T_lidar_imu = *calibration;
  } else {
    log_to(recording.remarks_->log(), LogLevel::kWarning,
           beside.string() + ": missing, and the IMU's poses are not the LiDAR's: they are left out");
    return ok();
  }
  if (oxts->empty()) return ok();
  const Pose T_imu_lidar = T_lidar_imu.inverse();
  const Pose T_first_world = (oxts->begin()->second.T_world_imu * T_imu_lidar).inverse();
  for (const ScanFile& scan : recording.scans_) {
    const auto found = oxts->find(scan.frame);
    if (found == oxts->end()) continue;
    recording.trajectory_.entries[scan.frame] = {scan.stamp_s, T_first_world * found->second.T_world_imu * T_imu_lidar};
    recording.gps_.push_back(found->second.fix_of(T_imu_lidar.translation()));
    recording.gps_.back().stamp_s = scan.stamp_s;
  }
  return ok();
}

bool is_folder_of_scans(const fs::path& folder) {
  std::error_code failure;
  if (fs::is_directory(folder / "velodyne_points" / "data", failure) || fs::is_directory(folder / "velodyne", failure))
    return true;
  for (fs::directory_iterator it(folder, failure), end; !failure && it != end; it.increment(failure))
    if (has_scan_extension(it->path())) return true;
  return false;
}

Result<std::unique_ptr<Recording>> open_folder(const fs::path& folder, const LogSink& log,
                                               const RecordingOptions& options) {
  std::error_code failure;
  const fs::path raw = folder / "velodyne_points" / "data", odometry = folder / "velodyne";
  const bool is_raw = fs::is_directory(raw, failure), is_odometry = fs::is_directory(odometry, failure);
  auto recording = std::make_unique<FolderRecording>();
  recording->remarks_ = std::make_shared<io_internal::Remarks>(log);
  recording->kind_ = "folder of scans";
  if (const Status listed = list_scans(is_raw ? raw : is_odometry ? odometry : folder, *recording); !listed)
    return listed.error();
  if (const Status added = is_raw        ? add_kitti_raw(*recording, folder)
                           : is_odometry ? add_kitti_odometry(*recording, folder)
                                         : find_side_files(*recording, folder);
      !added)
    return added.error();
  if (const fs::path wheels = folder / "wheel_odometry.tum"; is_present(wheels)) {
    const auto poses = read_poses(wheels);
    if (!poses) return poses.error();
    recording->wheel_odometry_ = recording->of_scans(*poses);
  }
  if (!options.poses_file.empty()) {
    auto trajectory = io_internal::read_trajectory(options.poses_file, *recording);
    if (!trajectory) return trajectory.error();
    recording->trajectory_ = *std::move(trajectory);
  }
  return std::unique_ptr<Recording>(std::move(recording));
}

}  // namespace

namespace {

Result<std::unique_ptr<Recording>> open_any(const fs::path& path, const LogSink& log, const RecordingOptions& options) {
  std::error_code failure;
  const fs::file_status status = fs::status(path, failure);
  if (status.type() == fs::file_type::not_found) return Error{path.string() + ": no such file or folder"};
  if (failure) return Error{path.string() + ": cannot be read: " + failure.message()};
  if (io_internal::is_capture(path)) return io_internal::open_capture_recording(path, options, log);
  if (!is_folder_of_scans(path) && io_internal::Bag::is_bag(path))
    return io_internal::open_bag_recording(path, options, log);
  if (!fs::is_directory(status))
    return Error{path.string() + ": is no recording: neither a folder of scans nor a bag (.bag, .mcap, .db3) nor a " +
                 "packet capture (.pcap)"};
  return open_folder(path, log, options);
}

}  // namespace

Result<std::unique_ptr<Recording>> open_recording(const fs::path& path, const LogSink& log,
                                                  const RecordingOptions& options) {
  try {
    return open_any(path, log, options);
  } catch (const std::exception& problem) {  // no memory, or what the readers underneath throw on broken files
    return Error{path.string() + ": cannot be read: " + problem.what()};
  }
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
