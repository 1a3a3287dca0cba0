// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <string>

#include <revisit/core/gps_fix.hpp>
#include <revisit/core/imu.hpp>
#include <revisit/core/pose.hpp>
#include <revisit/core/result.hpp>
#include <revisit/core/scan.hpp>

namespace revisit {

namespace io_internal {
class BagFileWriter;
}

/// Writes a bag that ROS reads: .bag (ROS 1), .mcap or .db3 (ROS 2), by the file's ending. Messages are to come about
/// in the order of their times. Belongs to one thread at a time.
class BagWriter {
 public:
  /// The file must not exist yet.
  static Result<BagWriter> create(const std::filesystem::path& file);
  BagWriter(BagWriter&&) noexcept;
  BagWriter& operator=(BagWriter&&) noexcept;
  ~BagWriter();

  /// A PointCloud2 of float32 x y z intensity, and where the scan has them uint16 ring and float32 time (seconds from
  /// the stamp). Recorded when the sweep has ended.
  Status write_scan(const std::string& topic, const std::string& frame_id, const Scan& scan);
  /// `sample` as in a scan with this stamp.
  Status write_imu(const std::string& topic, const std::string& frame_id, double stamp_s, const ImuSample& sample);
  Status write_fix(const std::string& topic, const std::string& frame_id, const GpsFix& fix);
  Status write_odometry(const std::string& topic, const std::string& frame_id, const std::string& child_frame_id,
                        double stamp_s, const Pose& T_frame_child);
  /// Recorded at `stamp_s`, before the first scan.
  Status write_static_transform(const std::string& parent, const std::string& child, double stamp_s,
                                const Pose& T_parent_child);
  /// Writes the index; without it the file is one that was cut off.
  Status finish();

 private:
  explicit BagWriter(std::unique_ptr<io_internal::BagFileWriter> file);
  Status write(const std::string& topic, const std::string& type, std::int64_t log_time_ns, const std::string& message);

  std::unique_ptr<io_internal::BagFileWriter> file_;
  std::map<std::string, std::size_t> topics_;
};

}  // namespace revisit
