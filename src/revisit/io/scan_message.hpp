// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include <revisit/core/log.hpp>
#include <revisit/core/result.hpp>
#include <revisit/core/scan.hpp>

namespace revisit {

struct ScanMessage {
  std::int64_t stamp_ns = 0;  ///< of its header
  std::string frame_id;
  Scan scan;  ///< the frame number is the caller's
};

/// Scans out of messages as they go over the wire, whatever packages are installed: sensor_msgs/PointCloud2, the
/// CustomMsg of both Livox drivers, velodyne_msgs/VelodyneScan. Immutable: safe to read with from several threads.
class ScanMessageReader {
 public:
  /// `type` as ROS 1 or 2 names it. `definition`: the text of the .msg, as a publisher of ROS 1 sends it or a bag holds
  /// it; empty for the usual one. `is_ros1`: how the bytes were written; otherwise as CDR. An error for other types.
  static Result<ScanMessageReader> make(const std::string& type, const std::string& definition, bool is_ros1);

  /// An error where bytes and definition part, naming `what` the message is.
  Result<ScanMessage> read(std::span<const std::uint8_t> bytes, const std::string& what, const LogSink& log = {}) const;

 private:
  struct Format;
  explicit ScanMessageReader(std::shared_ptr<const Format> format) : format_(std::move(format)) {}
  std::shared_ptr<const Format> format_;
};

}  // namespace revisit
