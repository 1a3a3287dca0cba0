// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>

namespace revisit {

/// How much a robot that is followed in a map is still believed to be there. Where it woke up in a place that looks the
/// same, the next scans fit after a fashion, but what they show differs: their log odds take the trust away, a little
/// more with each view, and at last it is lost.
class FollowingTrust {
 public:
  /// After one more scan, registered where it was predicted; `own_log_odds` is what this scan shows by itself,
  /// `travelled_m` the way since the last one that was followed: scans of one view count once, as in PoseBelief.
  FollowingTrust after(double own_log_odds, double travelled_m) const {
    const double view = std::clamp(travelled_m / kAnotherView_m, 0.0, 1.0);
    FollowingTrust next;
    next.log_odds_ = std::min(kMost, log_odds_ + view * std::clamp(own_log_odds, -kOneView, kOneView));
    return next;
  }
  bool is_gone() const { return log_odds_ < 0.0; }

 private:
  static constexpr double kAnotherView_m = 3.0;
  static constexpr double kMost = 6.0, kOneView = 2.0;  ///< log odds: in all, and what one view adds or takes
  double log_odds_ = kMost;
};

}  // namespace revisit
