// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>

#include <revisit/core/pose.hpp>

namespace revisit {

/// Whether an IMU tells how the sensor turns: its axes may be others, its times late, its units wrong. Learnt from what
/// it says of turns that scans show as well: a running median of the difference, which shrinks while differences are
/// smaller than it and grows while they are larger. A value: safe to copy and to read from several threads.
class ImuTrust {
 public:
  /// One more motion since the scan before, as the IMU has it turned and as registration found it. Only turns tell.
  void compare(const Pose& T_measured, const Pose& T_found) {
    if (std::max(rotation_angle(T_measured), rotation_angle(T_found)) < kLeastTurn_rad) return;
    const bool is_more = rotation_angle(T_measured.inverse() * T_found) > median_rad_;
    median_rad_ = std::clamp(median_rad_ * (is_more ? kStep : 1.0 / kStep), kLeast_rad, kUnknown_rad);
  }

  /// Of a turn that it measured, from scan to scan.
  double stddev_rad() const { return kLeast_rad + kMedians * median_rad_; }
  /// Whether so much is known of turns that none is unforeseen.
  bool is_trusted() const { return median_rad_ <= kTrusted_rad; }

  void archive(auto& fields) { fields(median_rad_); }

 private:
  static constexpr double kUnknown_rad = 0.05, kTrusted_rad = 0.01, kLeast_rad = 0.002;
  static constexpr double kLeastTurn_rad = 0.01, kStep = 1.1, kMedians = 1.5;
  double median_rad_ = kUnknown_rad;
};

}  // namespace revisit
