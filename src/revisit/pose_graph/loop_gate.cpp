// SPDX-License-Identifier: Apache-2.0
#include <revisit/pose_graph/loop_gate.hpp>

#include <algorithm>
#include <stdexcept>
#include <string>

namespace revisit {
namespace {

// Tolerances bound what two right loops and the odometry between them are off (docs/slam.md).
struct Consistency {
  static constexpr double kNear_m = 40.0;  ///< of odometry between the ends of two loops that can be compared
  static constexpr double kTolerance_m = 0.5, kTolerance_mAMetre = 0.02;
  static constexpr double kTolerance_deg = 3.0, kTolerance_degAMetre = 0.05;
  static constexpr double kSureAlone = 0.999;  ///< probability at which a loop needs no other
  // To join sessions, these must agree, with queries and matches over so much travelled distance: rows of like houses
  // and aisles are shorter, or show their ends.
  static constexpr std::size_t kFewestToJoin = 6;
  static constexpr double kLengthToJoin_m = 20.0;
  // In rooms, as sure in the mean as a loop must be alone: one look-alike of another building, and those that follow
  // from it, agree with each other for as long as the corridors do.
  static constexpr double kOwnInRooms_log_odds = 3.0;
  // Likewise where tracking was lost, and the loops say that the robot was still there when it went on.
  static constexpr std::size_t kFewestToGoOn = 3;
  static constexpr double kLengthToGoOn_m = 5.0, kStillThere_m = 5.0;
};

}  // namespace

void LoopGate::add_keyframe(FrameId frame, const TrajectoryPoint& point) {
  if (!keyframes_.empty() && frame <= keyframes_.back().frame)
    throw std::invalid_argument("key frame " + std::to_string(frame.value) + " after " +
                                std::to_string(keyframes_.back().frame.value) + "; allowed: increasing frames");
  keyframes_.push_back({frame, point});
}

bool LoopGate::has(FrameId frame) const {
  return std::binary_search(keyframes_.begin(), keyframes_.end(), Keyframe{frame, {}},
                            [](const Keyframe& a, const Keyframe& b) { return a.frame < b.frame; });
}

const TrajectoryPoint& LoopGate::at(FrameId frame) const {
  const auto found = std::lower_bound(keyframes_.begin(), keyframes_.end(), frame,
                                      [](const Keyframe& k, FrameId f) { return k.frame < f; });
  if (found == keyframes_.end() || found->frame != frame)
    throw std::invalid_argument("frame " + std::to_string(frame.value) + " is no key frame");
  return found->point;
}

LoopGate::Verdict LoopGate::compare(const LoopConstraint& a, const LoopConstraint& b) const {
  const TrajectoryPoint &match_a = at(a.match), &match_b = at(b.match), &query_a = at(a.query), &query_b = at(b.query);
  const auto matches_m = travelled_between_m(match_a, match_b), queries_m = travelled_between_m(query_a, query_b);
  if (!matches_m || !queries_m || *matches_m + *queries_m > 2.0 * Consistency::kNear_m) return Verdict::kNothing;
  const double travelled_m = *matches_m + *queries_m;
  const Pose circle =
      a.T_match_query * T_between(query_a, query_b) * b.T_match_query.inverse() * T_between(match_b, match_a);
  const bool agrees =
      circle.translation().norm() <= Consistency::kTolerance_m + Consistency::kTolerance_mAMetre * travelled_m &&
      rotation_angle(circle) <=
          to_radians(Consistency::kTolerance_deg + Consistency::kTolerance_degAMetre * travelled_m);
  return agrees ? Verdict::kAgree : Verdict::kContradict;
}

int LoopGate::root(int segment) const {
  for (auto it = joined_.find(segment); it != joined_.end(); it = joined_.find(segment)) segment = it->second;
  return segment;
}

int LoopGate::part(FrameId keyframe) const { return root(at(keyframe).segment); }

void LoopGate::join(const LoopConstraint& loop) {
  const int match = part(loop.match), query = part(loop.query);
  if (match != query) joined_[std::max(match, query)] = std::min(match, query);
}

bool LoopGate::joins_sessions(const LoopConstraint& loop) const {
  return session_of(loop.match) != session_of(loop.query) && part(loop.match) != part(loop.query);
}

// Between the last key frame before tracking was lost and the first one after it, by this loop and one that entered
// before.
bool LoopGate::goes_on_where_it_was(const LoopConstraint& loop) const {
  const TrajectoryPoint& query = at(loop.query);
  const auto first = std::find_if(keyframes_.begin(), keyframes_.end(),
                                  [&](const Keyframe& each) { return each.point.segment == query.segment; });
  if (first == keyframes_.begin() || session_of((first - 1)->frame) != session_of(first->frame)) return false;
  const TrajectoryPoint& last = (first - 1)->point;
  return std::any_of(entered_.begin(), entered_.end(), [&](const LoopConstraint& other) {
    const auto queries_m = travelled_between_m(at(other.query), last);
    const auto matches_m = travelled_between_m(at(other.match), at(loop.match));
    if (!queries_m || !matches_m || *queries_m + *matches_m > 2.0 * Consistency::kNear_m) return false;
    const Pose T_last_first = T_between(last, at(other.query)) * other.T_match_query.inverse() *
                              T_between(at(other.match), at(loop.match)) * loop.T_match_query *
                              T_between(query, first->point);
    return T_last_first.translation().norm() <= Consistency::kStillThere_m;
  });
}

// Of these loops, those in rooms show enough by themselves.
bool LoopGate::rooms_are_the_same(const LoopConstraint& loop, const std::vector<const LoopConstraint*>& agreeing) {
  double sum = 0.0;
  std::size_t rooms = 0;
  const auto count = [&](const LoopConstraint& each) {
    if (each.in_the_open) return;
    sum += each.own_log_odds;
    ++rooms;
  };
  count(loop);
  for (const LoopConstraint* each : agreeing) count(*each);
  return sum >= Consistency::kOwnInRooms_log_odds * static_cast<double>(rooms);
}

bool LoopGate::may_join(const LoopConstraint& loop, const std::vector<const LoopConstraint*>& agreeing) const {
  const bool goes_on = goes_on_where_it_was(loop);
  if (agreeing.size() + 1 < (goes_on ? Consistency::kFewestToGoOn : Consistency::kFewestToJoin)) return false;
  if (!goes_on && !rooms_are_the_same(loop, agreeing)) return false;
  double queries_m = 0.0, matches_m = 0.0;
  for (const LoopConstraint* a : agreeing)
    for (const LoopConstraint* b : agreeing) {
      queries_m = std::max(queries_m, travelled_between_m(at(a->query), at(b->query)).value_or(0.0));
      matches_m = std::max(matches_m, travelled_between_m(at(a->match), at(b->match)).value_or(0.0));
    }
  const auto contradicts = [&](const LoopConstraint& one) {
    return std::any_of(waiting_.begin(), waiting_.end(),
                       [&](const LoopConstraint& other) { return compare(one, other) == Verdict::kContradict; });
  };
  const bool is_contradicted =
      contradicts(loop) ||
      std::any_of(agreeing.begin(), agreeing.end(), [&](const LoopConstraint* each) { return contradicts(*each); });
  return !is_contradicted &&
         std::min(queries_m, matches_m) >= (goes_on ? Consistency::kLengthToGoOn_m : Consistency::kLengthToJoin_m);
}

LoopGate::Decision LoopGate::decide_alone(const LoopConstraint& loop) const {
  Decision decision{loop, loop.probability >= Consistency::kSureAlone && !joins_sessions(loop), 0};
  for (const LoopConstraint& other : entered_)
    if (compare(loop, other) == Verdict::kContradict) decision.enters = false;
  return decision;
}

std::vector<LoopGate::Decision> LoopGate::offer(const LoopConstraint& loop) {
  std::vector<Decision> decisions;
  Decision own{loop, false, 0};
  for (const LoopConstraint& other : entered_) own.agreeing += compare(loop, other) == Verdict::kAgree;
  std::vector<const LoopConstraint*> agreeing;
  for (const LoopConstraint& other : waiting_)
    if (compare(loop, other) == Verdict::kAgree) agreeing.push_back(&other);
  own.agreeing += agreeing.size();
  own.enters = own.agreeing > 0 && (!joins_sessions(loop) || may_join(loop, agreeing));
  if (!own.enters) {
    waiting_.push_back(loop);
    return decisions;
  }
  for (auto it = waiting_.begin(); it != waiting_.end();) {
    if (compare(loop, *it) != Verdict::kAgree) {
      ++it;
      continue;
    }
    entered_.push_back(*it);
    decisions.push_back({*it, true, 1});
    it = waiting_.erase(it);
  }
  entered_.push_back(loop);
  decisions.push_back(own);
  return decisions;
}

template <typename IsDue>
std::vector<LoopGate::Decision> LoopGate::decide(IsDue is_due) {
  std::vector<Decision> decisions;
  for (auto it = waiting_.begin(); it != waiting_.end();) {
    if (!is_due(*it)) {
      ++it;
      continue;
    }
    decisions.push_back(decide_alone(*it));
    if (decisions.back().enters) entered_.push_back(*it);
    it = waiting_.erase(it);
  }
  return decisions;
}

bool LoopGate::is_overdue(const LoopConstraint& loop) const {
  const auto travelled_m = travelled_between_m(keyframes_.back().point, at(loop.query));
  return !travelled_m || *travelled_m > Consistency::kNear_m;
}

std::vector<LoopGate::Decision> LoopGate::decide_overdue() {
  return decide([this](const LoopConstraint& loop) { return is_overdue(loop); });
}

std::vector<LoopGate::Decision> LoopGate::decide_all() {
  return decide([](const LoopConstraint&) { return true; });
}

}  // namespace revisit
