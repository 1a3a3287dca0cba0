// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>

#include <revisit/core/pose.hpp>
#include <revisit/core/twist.hpp>
#include <revisit/pipeline/loop_track.hpp>
#include <revisit/registration/feature_alignment.hpp>
#include <revisit/registration/icp.hpp>
#include <revisit/verification/geometric.hpp>

namespace revisit {

/// How the sensor moves, from each scan to the next: enough to undo the distortion of a sweep, and to tell how scans
/// lie that are a few metres apart. Learns on the way how well intensities of the same place agree with this sensor.
class EgoMotion {
 public:
  /// The motion during the coming scan, if it follows closely on the last: that of the last one, going on.
  std::optional<Twist> expected(double stamp_s) const;
  /// A scan on the one before.
  struct Step {
    double stamp_s = 0.0;
    std::shared_ptr<const ScanGeometry> scan;
    std::optional<Pose> T_last_scan;  ///< none where it was not found
    std::optional<Twist> motion;      ///< that it means
    /// How far from where it was expected that puts points 20 m away: then its distortion was not undone rightly.
    double surprise_m = 0.0;
    std::optional<Agreement> agreement;
  };
  /// Of a scan that was undistorted with what expected() said, or with what was found so.
  Step find(double stamp_s, std::shared_ptr<const ScanGeometry> scan) const;
  /// Goes on from there.
  void learn(Step step);

  /// Where the last scan was taken; another piece than the scan before where the motion between was not found.
  const Station& station() const { return station_; }

  /// How well scans agree with the one before them, once it is known from enough of them: the median of intensities of
  /// a moving sensor, the mean of inliers.
  UsualAgreement usual() const;
  /// The running mean over the last few; none where the last scan was not found.
  std::optional<double> inlier_ratio_lately() const { return inlier_ratio_lately_; }
  bool knows_intensities() const { return pairs_ >= kPairsThatTell; }

 private:
  void learn_intensities(double correlation);
  void learn_inliers(double ratio);
  static constexpr double kLongestGap_s = 0.5;
  std::shared_ptr<const ScanGeometry> last_;
  double last_stamp_s_ = 0.0;
  std::optional<Twist> motion_;
  Station station_;
  static constexpr std::size_t kFewestPairs = 10, kPairsThatTell = 200;
  static constexpr int kLastBin = 100;
  std::array<std::uint32_t, kLastBin + 1> correlations_{};  ///< histogram over [0, 1]
  std::size_t pairs_ = 0;
  std::optional<double> inlier_ratio_lately_;
  double inlier_ratio_sum_ = 0.0;
  std::size_t steps_ = 0;
};

}  // namespace revisit
