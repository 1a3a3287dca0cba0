// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include <revisit/core/pose.hpp>
#include <revisit/core/twist.hpp>

namespace revisit {

/// Where a scan may lie that was taken long after the one before, seen from that one: what it is registered from.
struct StartsInAGap {
  std::vector<Pose> likely;
  std::vector<Pose> unlikely;  ///< where none of the others fits well: it turned by more

  /// `T_previous_predicted` by the motion before, if any is known: half of that motion and none, turned by 20 degrees
  /// at most or, unlikely, by up to 120 either way.
  static StartsInAGap after(double gap_s, const Pose& T_previous_predicted, const std::optional<Twist>& motion);
  /// Of the second scan of a recording, which may have begun in motion: to every side, as far as a car gets.
  static StartsInAGap of_second_scan(double gap_s);
};

}  // namespace revisit
