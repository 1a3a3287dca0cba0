// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>

#include <revisit/core/gps_fix.hpp>
#include <revisit/core/log.hpp>
#include <revisit/core/result.hpp>
#include <revisit/io/scan_message.hpp>

#include "inbox.hpp"
#include "mode.hpp"

namespace revisit::node {

/// Clouds of one topic, turned into scans. Belongs to the node's thread.
class CloudReader {
 public:
  explicit CloudReader(LogSink log) : log_(std::move(log)) {}
  Result<ScanMessage> read(const Cloud& cloud, std::int64_t number);

 private:
  LogSink log_;
  std::string type_;  ///< of reader_
  std::optional<ScanMessageReader> reader_;
};

revisit::GpsFix to_gps_fix(const GpsFix& fix);
LogSink log_to(Outlet& outlet);

/// What tf and the other sensors say of each scan. Belongs to the node's thread.
class Moments {
 public:
  Moments(const Settings& settings, Inbox& inbox, Outlet& outlet);
  /// Waits for what still comes. The scan gets its IMU readings.
  Moment of(ScanMessage& message);

 private:
  bool look_up(const std::string& target, const std::string& source, std::int64_t stamp_ns, bool was_known,
               Pose& T_target_source);
  void find_odometry(const ScanMessage& message, Moment& moment);
  struct Sweep {
    double from_s = 0.0, to_s = 0.0;  ///< from the stamp
  };
  void add_imu(const Sweep& sweep, ScanMessage& message);

  const std::string odom_frame_, base_frame_;
  const bool publishes_poses_;
  Inbox& inbox_;
  Outlet& outlet_;
  int scans_ = 0;
  bool knew_base_ = false, had_odometry_ = false, has_warned_of_base_ = false, has_warned_of_imu_ = false;
};

}  // namespace revisit::node
