// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>

#include <revisit/core/scan.hpp>
#include <revisit/core/twist.hpp>
#include <revisit/registration/feature_alignment.hpp>

namespace revisit {

/// How the sensor moves, from each scan to the next: enough to undo the distortion of a sweep. No odometry: nothing is
/// summed up.
class EgoMotion {
 public:
  /// The motion during the coming scan, if it follows closely on the last: that of the last one, going on.
  std::optional<Twist> expected(double stamp_s) const;
  /// Learns from a scan that was undistorted with what expected() said.
  void learn(double stamp_s, std::shared_ptr<const ScanGeometry> scan);

 private:
  static constexpr double kLongestGap_s = 0.5;
  std::shared_ptr<const ScanGeometry> last_;
  double last_stamp_s_ = 0.0;
  std::optional<Twist> motion_;
};

}  // namespace revisit
