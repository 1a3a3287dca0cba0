// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include <revisit/core/pose.hpp>
#include <revisit/registration/scan_geometry.hpp>

namespace revisit {

/// How well consecutive scans of this sensor agree: scans of the same place hardly agree better. The defaults hold
/// until enough is known.
struct TypicalAgreement {
  double in_sight_ratio = 0.9;          ///< of inliers (Agreement), in (0, 1]
  double intensity_correlation = 0.95;  ///< in (0, 1]
  double residual = 0.08;               ///< point-to-plane, over the inliers: rms, in voxels

  void archive(auto& fields) { fields(in_sight_ratio, intensity_correlation, residual); }
};

/// Learns the typical agreement from pairs of consecutive scans while they come in. Belongs to one thread at a time.
class TypicalAgreementEstimate {
 public:
  /// Two scans in a row, and how they lie to each other by odometry. False where they agree so badly that odometry must
  /// be wrong: nothing is learnt then.
  bool add(const ScanGeometry& previous, const ScanGeometry& current, const Pose& T_previous_current);
  /// Odometry did not follow: what the last scans showed holds no longer.
  void interrupt() { recent_ratio_.reset(), recent_residual_.reset(); }

  /// Of the whole recording: the mean inlier ratio and residual, the median correlation while the sensor moved.
  TypicalAgreement overall() const;
  /// The same with the inlier ratio of the last few pairs where these are known: a field is not a street. The residual
  /// is the larger one of both: where scans lately agreed very well, others need not.
  TypicalAgreement recent() const;
  /// Starts from what an earlier run learnt, worth as much as `pairs` pairs.
  void restore(const TypicalAgreement& typical, std::size_t pairs);
  std::size_t pairs() const { return ratio_pairs_; }
  void archive(auto& fields) {
    fields(correlations_, correlation_pairs_, ratio_pairs_, ratio_sum_, recent_ratio_, residual_sum_, recent_residual_);
  }

 private:
  void add_correlation(double correlation, std::uint32_t times);

  static constexpr int kLastBin = 100;
  std::array<std::uint32_t, kLastBin + 1> correlations_{};  ///< histogram over [0, 1]
  std::size_t correlation_pairs_ = 0, ratio_pairs_ = 0;
  double ratio_sum_ = 0.0, residual_sum_ = 0.0;
  std::optional<double> recent_ratio_, recent_residual_;  ///< running means
};

}  // namespace revisit
