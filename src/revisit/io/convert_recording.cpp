// SPDX-License-Identifier: Apache-2.0
#include <revisit/core/text.hpp>
#include <revisit/io/convert_recording.hpp>

#include <optional>

#include <revisit/io/bag_writer.hpp>
#include <revisit/io/internal/text_writer.hpp>
#include <revisit/io/pose_file.hpp>

namespace revisit {
namespace {

namespace fs = std::filesystem;

// What takes the scans, one after the other.
class Target {
 public:
  virtual ~Target() = default;
  virtual Status add(const Scan& scan, const std::optional<Pose>& T_wheels_lidar) = 0;
  virtual Status finish(const Recording& recording) = 0;
};

class BagTarget final : public Target {
 public:
  BagTarget(BagWriter writer, fs::path file, std::vector<GpsFix> fixes)
      : writer_(std::move(writer)), file_(std::move(file)), fixes_(std::move(fixes)) {}

  Status add(const Scan& scan, const std::optional<Pose>& T_wheels_lidar) override {
    if (!std::exchange(has_frames_, true))
      if (const Status status = writer_.write_static_transform("base_link", kLidar, scan.stamp_s, Pose::Identity());
          !status)
        return status;
    // Readings come with two scans: with the one during which they were taken, and with the next.
    for (const ImuSample& sample : scan.imu)
      if (const double time_s = scan.stamp_s + sample.time_s; time_s > imu_until_s_ + kSameTime_s) {
        if (const Status status = writer_.write_imu("/imu", kLidar, scan.stamp_s, sample); !status) return status;
        imu_until_s_ = time_s;
      }
    for (; next_fix_ < fixes_.size() && fixes_[next_fix_].stamp_s <= scan.stamp_s; ++next_fix_)
      if (const Status status = writer_.write_fix("/fix", kLidar, fixes_[next_fix_]); !status) return status;
    if (T_wheels_lidar)
      if (const Status status = writer_.write_odometry("/odom", "odom", "base_link", scan.stamp_s, *T_wheels_lidar);
          !status)
        return status;
    return writer_.write_scan("/points", kLidar, scan);
  }

  Status finish(const Recording& recording) override {
    if (const Status status = writer_.finish(); !status) return status;
    return recording.trajectory().empty() ? ok()
                                          : write_tum_poses(file_.string() + ".poses.tum", recording.trajectory());
  }

 private:
  static constexpr const char* kLidar = "lidar";
  static constexpr double kSameTime_s = 1e-6;
  BagWriter writer_;
  fs::path file_;
  std::vector<GpsFix> fixes_;
  std::size_t next_fix_ = 0;
  bool has_frames_ = false;
  double imu_until_s_ =
      -2.0 * kSameTime_s;  ///< the clock of ROS begins at 0: readings before a first scan at 0 stay out
};

class KittiTarget final : public Target {
 public:
  explicit KittiTarget(fs::path folder) : folder_(std::move(folder)) {}

  Status add(const Scan& scan, const std::optional<Pose>& T_wheels_lidar) override {
    // Rows of times.txt belong to frame numbers: those that are missing get a row, too.
    while (static_cast<std::int64_t>(stamps_s_.size()) <= scan.frame.value) stamps_s_.push_back(scan.stamp_s);
    if (T_wheels_lidar) wheels_.entries[scan.frame] = {scan.stamp_s, *T_wheels_lidar};
    return write_kitti_scan(folder_, scan);
  }

  Status finish(const Recording& recording) override {
    if (recording.has_times()) {
      io_internal::TextWriter times(folder_ / "times.txt");
      for (const double stamp_s : stamps_s_) times.stream() << format("%.9f\n", stamp_s);
      if (const Status status = times.finish(); !status) return status;
    }
    if (!wheels_.empty())
      if (const Status status = write_tum_poses(folder_ / "wheel_odometry.tum", wheels_); !status) return status;
    if (recording.trajectory().empty()) return ok();
    if (const auto T_camera_lidar = recording.T_camera_lidar())
      if (const Status status = write_camera_calibration(folder_ / "calib.txt", *T_camera_lidar); !status)
        return status;
    return write_kitti_poses(folder_ / "poses.txt", recording.trajectory(), recording.T_camera_lidar());
  }

 private:
  fs::path folder_;
  std::vector<double> stamps_s_;
  Trajectory wheels_;
};

Result<std::unique_ptr<Target>> make_target(const fs::path& out, const Recording& recording) {
  if (is_bag_name(out)) {
    auto fixes = recording.gps_fixes({});
    if (!fixes) return fixes.error();
    auto writer = BagWriter::create(out);
    if (!writer) return writer.error();
    return std::unique_ptr<Target>(std::make_unique<BagTarget>(*std::move(writer), out, *std::move(fixes)));
  }
  std::error_code failure;
  if (fs::exists(out, failure) && (!fs::is_directory(out, failure) || !fs::is_empty(out, failure)))
    return Error{out.string() + ": holds something already; name a new or empty folder"};
  fs::create_directories(out, failure);
  if (failure) return Error{out.string() + ": cannot be made: " + failure.message()};
  return std::unique_ptr<Target>(std::make_unique<KittiTarget>(out));
}

}  // namespace

bool is_bag_name(const fs::path& file) {
  const std::string extension = file.extension().string();
  return extension == ".bag" || extension == ".mcap" || extension == ".db3";
}

Result<Converted> convert_recording(const Recording& recording, const fs::path& out, const LogSink& log,
                                    const std::function<bool(std::size_t)>& on_scan) {
  auto target = make_target(out, recording);
  if (!target) return target.error();
  Converted converted;
  bool loses_imu = !is_bag_name(out);
  Status problem = ok();
  for (std::size_t i = 0; i < recording.size(); ++i) {
    const auto scan = recording.read(i);
    if (scan) {
      if (loses_imu && (!scan->imu.empty() || scan->up)) {
        log_to(log, LogLevel::kWarning,
               out.string() + ": KITTI folders hold neither an IMU nor how the sensor is mounted: left out");
        loses_imu = false;
      }
      problem = (*target)->add(*scan, recording.wheel_pose(i));
      if (!problem) break;
      ++converted.scans;
    } else {
      ++converted.skipped;
      log_to(log, LogLevel::kWarning, scan.error().message + "; skipped");
    }
    if (on_scan && !on_scan(i + 1)) break;
  }
  // What was written until here is made readable, whatever happened.
  const Status finished = (*target)->finish(recording);
  if (!problem) return problem.error();
  if (!finished) return finished.error();
  return converted;
}

}  // namespace revisit
