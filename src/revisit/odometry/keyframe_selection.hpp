// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include <revisit/config/parameters.hpp>
#include <revisit/core/pose.hpp>
#include <revisit/core/scan.hpp>
#include <revisit/registration/seen_space.hpp>

namespace revisit {

/// The key frame rule: a scan becomes one after so much travelled distance or rotation since the last one, or where
/// much of what it sees was hidden from there. Belongs to one thread at a time.
class KeyframeSelection {
 public:
  explicit KeyframeSelection(const SlamOptions& options) : options_(options) {}

  /// `T_odom_lidar`: by odometry; `points`: of the scan, in its own frame, its sweep compensated.
  bool is_keyframe(const Pose& T_odom_lidar, std::span<const Point> points) const;
  /// The newest key frame; `seen` is what was visible from it.
  void set_last(const Pose& T_odom_lidar, SeenSpace seen);
  const Pose& T_odom_last() const { return T_odom_last_; }
  void archive(auto& fields) { fields(T_odom_last_, seen_from_last_); }

 private:
  SlamOptions options_;
  Pose T_odom_last_ = Pose::Identity();
  SeenSpace seen_from_last_;
};

}  // namespace revisit
