// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <map>
#include <vector>

#include <revisit/core/loop.hpp>
#include <revisit/core/trajectory_point.hpp>

namespace revisit {

/// Pairwise consistency (Mangelson et al., ICRA 2018): two loops close a circle with the odometry between their ends.
/// An accepted loop enters the graph once another one near it agrees; one that stays alone must be very sure, and no
/// loop that entered may contradict it. Between sessions that nothing joins yet, more of them must agree, over more of
/// the trajectory: a wrong join is the worst error there is. Where tracking was lost within a session that is joined,
/// fewer suffice if they say that it went on where it was. Belongs to one thread at a time.
class LoopGate {
 public:
  /// A key frame as odometry alone places it. Frames increase; otherwise std::invalid_argument.
  void add_keyframe(FrameId frame, const TrajectoryPoint& point);

  struct Decision {
    LoopConstraint loop;
    bool enters = false;
    std::size_t agreeing = 0;  ///< other loops nearby that agree
  };
  /// Decides about this loop, or about some that waited, or keeps it waiting. Its ends are key frames.
  std::vector<Decision> offer(const LoopConstraint& loop);
  /// A loop that entered in an earlier run.
  void restore(const LoopConstraint& loop) { entered_.push_back(loop); }
  /// The part of the map that a key frame is in: segments that loops join, by the number of the first of them.
  int part(FrameId keyframe) const;
  /// The loop is in the graph: it joins the parts of its ends.
  void join(const LoopConstraint& loop);
  /// Decides about the loops that nothing can confirm any more, because the newest key frame is too far from them.
  std::vector<Decision> decide_overdue();
  /// Decides about all that wait: no more will come.
  std::vector<Decision> decide_all();

  std::size_t keyframes() const { return keyframes_.size(); }
  bool has(FrameId keyframe) const;
  void archive(auto& fields) {
    fields(keyframes_, entered_, waiting_, joined_);
    for (std::size_t i = 1; i < keyframes_.size(); ++i) fields.require(keyframes_[i - 1].frame < keyframes_[i].frame);
    for (const auto* const loops : {&entered_, &waiting_})
      for (const LoopConstraint& each : *loops) fields.require(has(each.match) && has(each.query));
    for (const auto& [segment, earlier] : joined_) fields.require(earlier < segment);
  }

 private:
  struct Keyframe {
    FrameId frame;
    TrajectoryPoint point;

    void archive(auto& fields) { fields(frame, point); }
  };
  enum class Verdict { kNothing, kAgree, kContradict };
  const TrajectoryPoint& at(FrameId frame) const;
  Verdict compare(const LoopConstraint& a, const LoopConstraint& b) const;
  bool is_overdue(const LoopConstraint& loop) const;
  bool joins_sessions(const LoopConstraint& loop) const;
  bool goes_on_where_it_was(const LoopConstraint& loop) const;
  static bool rooms_are_the_same(const LoopConstraint& loop, const std::vector<const LoopConstraint*>& agreeing);
  bool may_join(const LoopConstraint& loop, const std::vector<const LoopConstraint*>& agreeing) const;
  int root(int segment) const;
  Decision decide_alone(const LoopConstraint& loop) const;
  template <typename IsDue>
  std::vector<Decision> decide(IsDue is_due);

  std::vector<Keyframe> keyframes_;
  std::vector<LoopConstraint> entered_, waiting_;
  std::map<int, int> joined_;  ///< segments to an earlier one of their part
};

}  // namespace revisit
