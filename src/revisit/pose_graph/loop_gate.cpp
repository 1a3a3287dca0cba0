// SPDX-License-Identifier: Apache-2.0
#include <revisit/pose_graph/loop_gate.hpp>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

namespace revisit {
namespace {

constexpr double kNear_m = 40.0;  // of odometry between the ends of two loops that can be compared
constexpr double kSureAlone = 0.999;

}  // namespace

void LoopGate::add_keyframe(FrameId frame, const Pose& T_odom_lidar, bool starts_anew) {
  Keyframe next{frame, T_odom_lidar, 0.0, 0};
  if (!keyframes_.empty()) {
    const Keyframe& last = keyframes_.back();
    if (frame <= last.frame)
      throw std::invalid_argument("key frame " + std::to_string(frame.value) + " after " +
                                  std::to_string(last.frame.value) + "; allowed: increasing frames");
    next.way_m = last.way_m + (last.T_odom_lidar.inverse() * T_odom_lidar).translation().norm();
    next.segment = last.segment + (starts_anew ? 1 : 0);
  }
  keyframes_.push_back(next);
}

const LoopGate::Keyframe& LoopGate::at(FrameId frame) const {
  const auto found = std::lower_bound(keyframes_.begin(), keyframes_.end(), frame,
                                      [](const Keyframe& k, FrameId f) { return k.frame < f; });
  if (found == keyframes_.end() || found->frame != frame)
    throw std::invalid_argument("frame " + std::to_string(frame.value) + " is no key frame");
  return *found;
}

LoopGate::Verdict LoopGate::compare(const LoopRow& a, const LoopRow& b) const {
  const Keyframe &match_a = at(a.constraint.match), &match_b = at(b.constraint.match);
  const Keyframe &query_a = at(a.constraint.query), &query_b = at(b.constraint.query);
  const double way_m = std::abs(match_a.way_m - match_b.way_m) + std::abs(query_a.way_m - query_b.way_m);
  if (match_a.segment != match_b.segment || query_a.segment != query_b.segment || way_m > 2.0 * kNear_m)
    return Verdict::kNothing;
  const Pose round = a.constraint.T_match_query * (query_a.T_odom_lidar.inverse() * query_b.T_odom_lidar) *
                     b.constraint.T_match_query.inverse() * (match_b.T_odom_lidar.inverse() * match_a.T_odom_lidar);
  // What two right loops and the odometry between them are off, at most.
  const double most_m = 0.5 + 0.02 * way_m, most_rad = to_radians(3.0 + 0.05 * way_m);
  return round.translation().norm() <= most_m && rotation_angle(round) <= most_rad ? Verdict::kAgree
                                                                                   : Verdict::kContradict;
}

LoopGate::Decision LoopGate::judge_alone(const LoopRow& loop) const {
  Decision decision{loop, loop.constraint.probability >= kSureAlone, 0};
  for (const LoopRow& other : entered_)
    if (compare(loop, other) == Verdict::kContradict) decision.enters = false;
  return decision;
}

std::vector<LoopGate::Decision> LoopGate::offer(const LoopRow& loop) {
  std::vector<Decision> decisions;
  Decision own{loop, false, 0};
  for (const LoopRow& other : entered_) own.agreeing += compare(loop, other) == Verdict::kAgree;
  for (auto it = waiting_.begin(); it != waiting_.end();) {
    if (compare(loop, *it) != Verdict::kAgree) {
      ++it;
      continue;
    }
    ++own.agreeing;
    entered_.push_back(*it);
    decisions.push_back({*it, true, 1});
    it = waiting_.erase(it);
  }
  own.enters = own.agreeing > 0;
  if (own.enters) {
    entered_.push_back(loop);
    decisions.push_back(own);
  } else {
    waiting_.push_back(loop);
  }
  return decisions;
}

std::vector<LoopGate::Decision> LoopGate::decide_waiting(bool is_end) {
  std::vector<Decision> decisions;
  for (auto it = waiting_.begin(); it != waiting_.end();) {
    if (!is_end && keyframes_.back().way_m - at(it->constraint.query).way_m <= kNear_m) {
      ++it;
      continue;
    }
    decisions.push_back(judge_alone(*it));
    if (decisions.back().enters) entered_.push_back(*it);
    it = waiting_.erase(it);
  }
  return decisions;
}

}  // namespace revisit
