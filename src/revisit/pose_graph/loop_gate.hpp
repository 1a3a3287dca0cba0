// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <vector>

#include <revisit/core/pose.hpp>
#include <revisit/core/results.hpp>

namespace revisit {

/// Pairwise consistency (Mangelson et al., ICRA 2018): two loops close a circle with the odometry between their ends.
/// A loop enters the graph once another one near it says the same; one that stays alone must be very sure of itself.
/// Belongs to one thread at a time.
class LoopGate {
 public:
  /// A key frame as odometry alone places it. Frames increase. `starts_anew`: tracking was lost before it.
  void add_keyframe(FrameId frame, const Pose& T_odom_lidar, bool starts_anew);

  struct Decision {
    LoopRow loop;
    bool enters = false;
    std::size_t agreeing = 0;  ///< other loops nearby that say the same
  };
  /// Decides about this loop, or about some that waited, or keeps it waiting. Its ends are key frames.
  std::vector<Decision> offer(const LoopRow& loop);
  /// A loop that entered in an earlier run.
  void restore(const LoopRow& loop) { entered_.push_back(loop); }
  /// Decides about those whom nobody can confirm any more, as the newest key frame lies too far from them; at the end,
  /// about all.
  std::vector<Decision> decide_waiting(bool is_end);

 private:
  struct Keyframe {
    FrameId frame;
    Pose T_odom_lidar = Pose::Identity();
    double way_m = 0.0;  ///< along the trajectory, until here
    int segment = 0;     ///< between two losses of track
  };
  enum class Verdict { kNothing, kAgree, kContradict };
  const Keyframe& at(FrameId frame) const;
  Verdict compare(const LoopRow& a, const LoopRow& b) const;
  Decision judge_alone(const LoopRow& loop) const;

  std::vector<Keyframe> keyframes_;
  std::vector<LoopRow> entered_, waiting_;
};

}  // namespace revisit
