// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>

#include <revisit/core/scan.hpp>
#include <revisit/core/twist.hpp>
#include <revisit/registration/feature_alignment.hpp>

namespace revisit {

/// How the sensor moves, from each scan to the next: enough to undo the distortion of a sweep. No odometry: nothing is
/// summed up. Learns on the way how well intensities of the same place agree with this sensor.
class EgoMotion {
 public:
  /// The motion during the coming scan, if it follows closely on the last: that of the last one, going on.
  std::optional<Twist> expected(double stamp_s) const;
  /// Learns from a scan that was undistorted with what expected() said.
  void learn(double stamp_s, std::shared_ptr<const ScanGeometry> scan);

  /// The median correlation of intensities between consecutive scans of a moving sensor, once it is known from
  /// enough of them.
  std::optional<double> usual_intensity_correlation() const;
  bool knows_intensities() const { return pairs_ >= kPairsThatTell; }

 private:
  void learn_intensities(double correlation);
  static constexpr double kLongestGap_s = 0.5;
  std::shared_ptr<const ScanGeometry> last_;
  double last_stamp_s_ = 0.0;
  std::optional<Twist> motion_;
  static constexpr std::size_t kFewestPairs = 10, kPairsThatTell = 200;
  static constexpr int kLastBin = 100;
  std::array<std::uint32_t, kLastBin + 1> correlations_{};  ///< histogram over [0, 1]
  std::size_t pairs_ = 0;
};

}  // namespace revisit
