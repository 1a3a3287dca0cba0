// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>

#include <revisit/core/pose.hpp>

namespace revisit {

/// How far an IMU is trusted to tell turns: its axes or units may be wrong, its times late. Learnt from turns that
/// scans show as well, as a running median of the differences: it shrinks by a tenth where a difference is smaller, and
/// grows by a tenth where it is larger. A value: safe to copy and to read from several threads.
class ImuTrust {
 public:
  /// The motion since the scan before, with the rotation that the IMU measured and with the one that registration
  /// found. Ignored where neither turns by 0.6 degrees.
  void compare(const Pose& T_measured, const Pose& T_found) {
    if (std::max(rotation_angle(T_measured), rotation_angle(T_found)) < kLeastTurn_rad) return;
    const bool is_more = rotation_angle(T_measured.inverse() * T_found) > median_rad_;
    median_rad_ = std::clamp(median_rad_ * (is_more ? kStep : 1.0 / kStep), kLeast_rad, kUnknown_rad);
  }

  /// Standard deviation of a turn that it measured from one scan to the next.
  double stddev_rad() const { return kLeast_rad + kMedians * median_rad_; }
  /// Whether it was right so far to 0.6 degrees, in the median.
  bool is_trusted() const { return median_rad_ <= kTrusted_rad; }

  void archive(auto& fields) { fields(median_rad_); }

 private:
  // The median at first and at most, where it is trusted, and at least.
  static constexpr double kUnknown_rad = 0.05, kTrusted_rad = 0.01, kLeast_rad = 0.002;
  static constexpr double kLeastTurn_rad = 0.01, kStep = 1.1, kMedians = 1.5;  ///< medians: in a standard deviation
  double median_rad_ = kUnknown_rad;
};

}  // namespace revisit
