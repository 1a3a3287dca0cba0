// SPDX-License-Identifier: Apache-2.0
#include <revisit/evaluation/session_table.hpp>

#include <algorithm>

#include <revisit/evaluation/trajectory_table.hpp>

namespace revisit {
namespace {

constexpr double kWrong_m = 1.0, kOfAlone = 2.0;

// Of all key frames that pass, after one alignment.
template <typename Passes>
double ate_m(const std::map<FrameId, MapKeyframe>& keyframes, const std::map<FrameId, Pose>& truth, Passes passes) {
  Trajectory estimate, reference;
  for (const auto& [frame, keyframe] : keyframes) {
    const auto found = truth.find(frame);
    if (found == truth.end() || !passes(frame, keyframe)) continue;
    const double stamp_s = static_cast<double>(estimate.entries.size());
    estimate.entries[frame] = {stamp_s, keyframe.T_map_lidar};
    reference.entries[frame] = {stamp_s, found->second};
  }
  return estimate.entries.size() < 3 ? 0.0 : evaluate_trajectory(estimate, reference).ate_m;
}

}  // namespace

SessionTable evaluate_sessions(const std::map<FrameId, MapKeyframe>& keyframes, const std::map<FrameId, Pose>& truth) {
  SessionTable table;
  std::map<int, int> first_of_part;
  for (const auto& [frame, keyframe] : keyframes) {
    const int id = session_of(frame);
    first_of_part.try_emplace(keyframe.part, id);
    if (table.sessions.empty() || table.sessions.back().id != id) table.sessions.push_back({id, keyframe.part});
    ++table.sessions.back().keyframes;
  }
  for (const auto& [part, first] : first_of_part)
    table.ate_m[part] = ate_m(keyframes, truth, [&, p = part](FrameId, const MapKeyframe& k) { return k.part == p; });
  for (SessionTable::Session& each : table.sessions) {
    const int first = first_of_part.at(each.part);
    const auto alone_m = [&](int id) {
      return ate_m(keyframes, truth,
                   [&](FrameId f, const MapKeyframe& k) { return session_of(f) == id && k.part == each.part; });
    };
    each.ate_alone_m = alone_m(each.id);
    each.ate_joined_m = ate_m(keyframes, truth, [&](FrameId f, const MapKeyframe& k) {
      return (session_of(f) == each.id || session_of(f) == first) && k.part == each.part;
    });
    each.is_wrong = each.ate_joined_m > kWrong_m + kOfAlone * std::max(each.ate_alone_m, alone_m(first));
    table.wrong_joins += each.is_wrong;
    table.joined += each.part == table.sessions.front().part;
  }
  return table;
}

}  // namespace revisit
