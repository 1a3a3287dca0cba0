// SPDX-License-Identifier: Apache-2.0
#include <revisit/pipeline/ego_motion.hpp>

#include <algorithm>
#include <cmath>

#include <revisit/registration/icp.hpp>

namespace revisit {

std::optional<Twist> EgoMotion::expected(double stamp_s) const {
  const double gap_s = stamp_s - last_stamp_s_;
  return gap_s > 0.0 && gap_s <= kLongestGap_s ? motion_ : std::nullopt;
}

EgoMotion::Step EgoMotion::find(double stamp_s, std::shared_ptr<const ScanGeometry> scan) const {
  Step step;
  step.stamp_s = stamp_s;
  step.scan = std::move(scan);
  const double gap_s = stamp_s - last_stamp_s_;
  if (!last_ || !(gap_s > 0.0 && gap_s <= kLongestGap_s)) return step;
  // From a standstill the first time: a car goes 3 m in a tenth of a second.
  const Pose T_guess = motion_ ? motion_after(*motion_, gap_s) : Pose::Identity();
  const IcpResult icp =
      align_icp(last_->surface(), step.scan->surface().points(), T_guess, {.coarse_m = motion_ ? 1.0 : 4.0});
  constexpr double kInlier_m = 0.4, kFewestInliers = 0.4;
  const Agreement agreement = measure_agreement(last_->surface(), step.scan->surface(), icp.T_target_source, kInlier_m);
  if (!icp.converged || agreement.inlier_ratio < kFewestInliers) return step;
  constexpr double kArm_m = 20.0;
  const Pose off = T_guess.inverse() * icp.T_target_source;
  step.surprise_m = off.translation().norm() + kArm_m * rotation_angle(off);
  step.T_last_scan = icp.T_target_source;
  step.motion = twist_of(icp.T_target_source, gap_s);
  step.agreement = agreement;
  return step;
}

void EgoMotion::learn(Step step) {
  // Of scans from the same spot, intensities would agree too well.
  constexpr double kStill_m = 0.05;
  if (step.agreement) {
    if (step.agreement->intensity_correlation && step.T_last_scan->translation().norm() > kStill_m)
      learn_intensities(*step.agreement->intensity_correlation);
    learn_inliers(step.agreement->inlier_ratio);
  } else {
    inlier_ratio_lately_.reset();
  }
  station_ = step.T_last_scan ? station_.after(*step.T_last_scan) : Station{.piece = station_.piece + 1};
  motion_ = step.motion;
  last_ = std::move(step.scan);
  last_stamp_s_ = step.stamp_s;
}

void EgoMotion::learn_inliers(double ratio) {
  constexpr double kNewShare = 0.3;  // of the last scan in the running mean
  inlier_ratio_lately_ =
      inlier_ratio_lately_ ? *inlier_ratio_lately_ + kNewShare * (ratio - *inlier_ratio_lately_) : ratio;
  inlier_ratio_sum_ += ratio;
  ++steps_;
}

void EgoMotion::learn_intensities(double correlation) {
  const auto bin = static_cast<std::size_t>(std::lround(std::clamp(correlation, 0.0, 1.0) * kLastBin));
  ++correlations_[bin];
  ++pairs_;
}

UsualAgreement EgoMotion::usual() const {
  UsualAgreement usual;
  if (steps_ >= kFewestPairs) usual.inlier_ratio = inlier_ratio_sum_ / static_cast<double>(steps_);
  if (pairs_ < kFewestPairs) return usual;
  std::size_t bin = 0, below = correlations_[0];
  while (2 * below < pairs_) below += correlations_[++bin];
  // Intensities that agree badly even here tell nothing elsewhere.
  constexpr double kLeast = 0.1;
  usual.intensity_correlation = std::max(kLeast, static_cast<double>(bin) / kLastBin);
  return usual;
}

}  // namespace revisit
