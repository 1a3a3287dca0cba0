// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>

#include <revisit/localisation/pose_belief.hpp>

namespace revisit {

/// Whether a robot that is followed through rooms of a map is still believed to be where it is followed. If it woke up
/// in a look-alike, the next scans can be registered there, but fit less well than in the right place: what each view
/// has beyond log odds of PoseBelief::kAskedOfAlike is added up, and below 0 the robot is lost. A value: safe to copy
/// and to read from several threads.
class FollowingTrust {
 public:
  /// After one more scan, registered where it was predicted. `own_log_odds` that the pose is right, by this scan alone;
  /// `travelled_m` since the last scan that was followed: scans of one view count once, as in PoseBelief.
  FollowingTrust after(double own_log_odds, double travelled_m) const {
    const double view = std::clamp(travelled_m / PoseBelief::kAnotherView_m, 0.0, 1.0);
    FollowingTrust next;
    next.log_odds_ =
        std::min(kMost, log_odds_ + view * std::clamp(own_log_odds - PoseBelief::kAskedOfAlike, -kOneView, kOneView));
    return next;
  }
  bool is_gone() const { return log_odds_ < 0.0; }

 private:
  static constexpr double kMost = 6.0, kOneView = 2.0;  ///< log odds: in all, and what one view adds or takes
  double log_odds_ = kOneView;                          ///< of a robot that has just woken up
};

}  // namespace revisit
