// SPDX-License-Identifier: Apache-2.0
#include <revisit/pipeline/ego_motion.hpp>

#include <revisit/registration/icp.hpp>

namespace revisit {

std::optional<Twist> EgoMotion::expected(double stamp_s) const {
  const double gap_s = stamp_s - last_stamp_s_;
  return gap_s > 0.0 && gap_s <= kLongestGap_s ? motion_ : std::nullopt;
}

void EgoMotion::learn(double stamp_s, std::shared_ptr<const ScanGeometry> scan) {
  const double gap_s = stamp_s - last_stamp_s_;
  const bool follows = last_ && gap_s > 0.0 && gap_s <= kLongestGap_s;
  std::optional<Twist> motion;
  if (follows) {
    // From a standstill the first time: a car goes 3 m in a tenth of a second.
    const Pose T_guess = motion_ ? motion_after(*motion_, gap_s) : Pose::Identity();
    const IcpResult icp = align_icp(last_->surface(), scan->surface(), T_guess, motion_ ? 1.0 : 4.0);
    constexpr double kInlier_m = 0.4, kFewestInliers = 0.4;
    if (icp.converged &&
        measure_agreement(last_->surface(), scan->surface(), icp.T_target_source, kInlier_m).inlier_ratio >=
            kFewestInliers)
      motion = twist_of(icp.T_target_source, gap_s);
  }
  motion_ = motion;
  last_ = std::move(scan);
  last_stamp_s_ = stamp_s;
}

}  // namespace revisit
