// SPDX-License-Identifier: Apache-2.0
#include <revisit/pipeline/known_ground.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>
#include <optional>
#include <set>

#include <revisit/pose_graph/edge_information.hpp>
#include <revisit/store/keyframe_bytes.hpp>

namespace revisit {
namespace {

struct Known {
  static constexpr double kBeside_m = 2.0;      ///< an earlier place so near shows the same
  static constexpr double kHeading_deg = 30.0;  ///< where the sensor does not see all round
  static constexpr double kAllRound = 0.9;      ///< share of the directions in which something was seen
  static constexpr double kRecognised_m = 5.0;  ///< travelled from a key frame with a loop
  static constexpr int kAppearances = 4;        ///< of one place, where it looks another way and is not recognised
};

Result<bool> sees_all_round(const MapStore& store, FrameId place) {
  const auto bytes = store.part(place, MapStore::Part::kPlace);
  if (!bytes) return bytes.error();
  const auto cloud = to_thin_cloud(*bytes);
  if (!cloud) return store.damaged("place", place);
  constexpr std::size_t kDirections = 72;
  std::array<bool, kDirections> seen{};
  for (const Eigen::Vector3f& p : cloud->points) {
    const double turn = std::atan2(p.y(), p.x()) / (2.0 * kPi) + 0.5;
    seen[std::min(kDirections - 1, static_cast<std::size_t>(turn * kDirections))] = true;
  }
  return static_cast<double>(std::count(seen.begin(), seen.end(), true)) >= Known::kAllRound * kDirections;
}

// Key frames that were recognised by loops with earlier sessions, or that were not far from one that was.
std::vector<bool> recognised(const StoredMap& map) {
  std::set<FrameId> found;
  for (const LoopConstraint& loop : map.loops)
    if (session_of(loop.query) != session_of(loop.match)) found.insert(std::max(loop.query, loop.match));
  std::vector<bool> result(map.keyframes.size());
  for (const bool backwards : {false, true}) {
    double since_m = Known::kRecognised_m;
    for (std::size_t n = 0; n < result.size(); ++n) {
      const std::size_t i = backwards ? result.size() - 1 - n : n;
      if (n > 0) {
        const auto& a = map.keyframes[i].point;
        const auto& b = map.keyframes[backwards ? i + 1 : i - 1].point;
        const auto travelled_m = travelled_between_m(a, b);
        since_m = travelled_m ? since_m + *travelled_m : Known::kRecognised_m;
      }
      if (found.contains(map.keyframes[i].frame.frame)) since_m = 0.0;
      result[i] = result[i] || since_m < Known::kRecognised_m;
    }
  }
  return result;
}

// The places that the map needs: those of which earlier sessions have another one beside them are left out, where it
// was recognised there, or looks another way for the umpteenth time.
Result<std::set<FrameId>> needed_places(const MapStore& store, const StoredMap& map) {
  const auto places = store.places();
  if (!places) return places.error();
  std::map<FrameId, const StoredMap::Keyframe*> of_frame;
  for (const auto& each : map.keyframes) of_frame[each.frame.frame] = &each;
  const std::vector<bool> is_recognised = recognised(map);
  std::set<FrameId> needed;
  std::map<std::array<int, 4>, std::vector<FrameId>> by_cell;  // part, and cells as wide as the reach
  const auto cell_of = [](const StoredMapPose& at) {
    const Eigen::Vector3i cell = (at.T_map_lidar.translation() / Known::kBeside_m).array().floor().cast<int>();
    return std::array<int, 4>{at.part, cell.x(), cell.y(), cell.z()};
  };
  for (const FrameId place : *places) {
    const auto found = of_frame.find(place);
    if (found == of_frame.end()) return Error{store.file() + ": a place of the map is no key frame"};
    const auto& here = found->second->settled;
    std::optional<bool> all_round;
    int beside = 0;
    const auto count_beside = [&](FrameId other) -> Status {
      const Pose T = of_frame.at(other)->settled->T_map_lidar.inverse() * here->T_map_lidar;
      if (session_of(other) == session_of(place) || T.translation().norm() > Known::kBeside_m) return ok();
      if (!all_round) {
        const auto seen = sees_all_round(store, place);
        if (!seen) return seen.error();
        all_round = *seen;
      }
      beside += *all_round || to_degrees(rotation_angle(T)) < Known::kHeading_deg;
      return ok();
    };
    for (int around = 0; here && around < 27; ++around) {
      std::array<int, 4> cell = cell_of(*here);
      cell[1] += around % 3 - 1, cell[2] += around / 3 % 3 - 1, cell[3] += around / 9 - 1;
      const auto others = by_cell.find(cell);
      if (others == by_cell.end()) continue;
      for (const FrameId other : others->second)
        if (const Status counted = count_beside(other); !counted) return counted.error();
    }
    const std::size_t index = static_cast<std::size_t>(found->second - map.keyframes.data());
    if (beside > 0 && (is_recognised[index] || beside >= Known::kAppearances)) continue;
    needed.insert(place);
    if (here) by_cell[cell_of(*here)].push_back(place);
  }
  return needed;
}

// GPS holds the map on the earth: of key frames that would go, one keeps its fix where no other one is near.
void keep_fixes(const std::vector<StoredFix>& fixes, const StoredMap& map, std::vector<bool>& stays) {
  constexpr double kApart_m = 15.0;
  std::set<FrameId> has_fix;
  for (const StoredFix& each : fixes) has_fix.insert(each.keyframe);
  std::vector<std::size_t> kept;
  for (const bool first : {true, false})
    for (std::size_t i = 0; i < stays.size(); ++i) {
      const auto& each = map.keyframes[i];
      if (stays[i] != first || !each.settled || !has_fix.contains(each.frame.frame)) continue;
      const bool is_covered = !first && std::any_of(kept.begin(), kept.end(), [&](std::size_t other) {
        const StoredMapPose& there = *map.keyframes[other].settled;
        const Eigen::Vector3d apart_m = there.T_map_lidar.translation() - each.settled->T_map_lidar.translation();
        return there.part == each.settled->part && apart_m.norm() < kApart_m;
      });
      if (is_covered) continue;
      stays[i] = true;
      kept.push_back(i);
    }
}

// Whatever was one part before stays one: a session without which it would fall apart keeps all it has, and what its
// loops lead to.
void keep_together(const StoredMap& map, std::vector<bool>& stays) {
  std::map<FrameId, std::size_t> index;
  for (std::size_t i = 0; i < stays.size(); ++i) index[map.keyframes[i].frame.frame] = i;
  for (bool is_whole = false; !is_whole;) {
    is_whole = true;
    std::vector<std::size_t> root(stays.size());
    std::iota(root.begin(), root.end(), std::size_t{0});
    const auto find = [&](std::size_t i) {
      while (root[i] != i) i = root[i] = root[root[i]];
      return i;
    };
    std::optional<std::size_t> last;  // that stays
    bool is_gap = true;
    for (std::size_t i = 0; i < stays.size(); ++i) {
      is_gap = is_gap || i == 0 || map.keyframes[i].point.segment != map.keyframes[i - 1].point.segment;
      if (!stays[i]) continue;
      if (last && !is_gap) root[find(i)] = find(*last);
      last = i;
      is_gap = false;
    }
    for (const LoopConstraint& loop : map.loops)
      if (const std::size_t a = index.at(loop.match), b = index.at(loop.query); stays[a] && stays[b])
        root[find(a)] = find(b);
    std::map<int, std::size_t> root_of_part;
    std::set<int> torn;  // sessions
    for (std::size_t i = 0; i < stays.size(); ++i) {
      const auto& settled = map.keyframes[i].settled;
      if (!stays[i] || !settled) continue;
      if (root_of_part.try_emplace(settled->part, find(i)).first->second != find(i))
        torn.insert(session_of(map.keyframes[i].frame.frame));
    }
    const auto keep = [&](std::size_t i) {
      if (stays[i]) return;
      stays[i] = true;
      is_whole = false;
    };
    for (std::size_t i = 0; i < stays.size(); ++i)
      if (torn.contains(session_of(map.keyframes[i].frame.frame))) keep(i);
    for (const LoopConstraint& loop : map.loops) {
      if (!torn.contains(session_of(loop.match)) && !torn.contains(session_of(loop.query))) continue;
      keep(index.at(loop.match));
      keep(index.at(loop.query));
    }
  }
}

}  // namespace

Result<bool> remove_known_ground(MapStore& store, const StoredMap& map) {
  const auto is_place = needed_places(store, map);
  if (!is_place) return is_place.error();
  std::set<FrameId> has_loop;
  for (const LoopConstraint& loop : map.loops)
    if (is_place->contains(loop.query) || is_place->contains(loop.match)) {
      has_loop.insert(loop.query);
      has_loop.insert(loop.match);
    }
  // Sessions that stand alone in their part keep all they have, and so does the first of each part.
  std::map<int, int> first_session_of_part;
  for (const auto& each : map.keyframes)
    if (each.settled) first_session_of_part.try_emplace(each.settled->part, session_of(each.frame.frame));
  const auto is_joined = [&](const StoredMap::Keyframe& each) {
    return each.settled && first_session_of_part.at(each.settled->part) != session_of(each.frame.frame);
  };
  std::vector<bool> stays(map.keyframes.size());
  for (std::size_t i = 0; i < stays.size(); ++i)
    stays[i] = is_place->contains(map.keyframes[i].frame.frame) || !is_joined(map.keyframes[i]);
  // Whatever joins a run of new places to what was known: before it and after it.
  const std::vector<bool> wanted = stays;
  const auto session = [&](std::size_t i) { return session_of(map.keyframes[i].frame.frame); };
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    if (!wanted[i] || !is_joined(map.keyframes[i])) continue;
    for (std::size_t k = i; k-- > 0 && session(k) == session(i) && !wanted[k];)
      if (has_loop.contains(map.keyframes[k].frame.frame)) {
        stays[k] = true;
        break;
      }
    for (std::size_t k = i + 1; k < wanted.size() && session(k) == session(i) && !wanted[k]; ++k)
      if (has_loop.contains(map.keyframes[k].frame.frame)) {
        stays[k] = true;
        break;
      }
  }
  const auto fixes = store.fixes();
  if (!fixes) return fixes.error();
  keep_fixes(*fixes, map, stays);
  keep_together(map, stays);
  std::vector<FrameId> removed;
  std::vector<MapStore::Joint> joints;
  std::optional<MapStore::Joint> joint;  // from the last one that stays to the one at work
  FrameId last;
  for (std::size_t i = 0; i < stays.size(); ++i) {
    const StoredMap::Keyframe& each = map.keyframes[i];
    const FrameId frame = each.frame.frame;
    if (each.edge) {
      const bool starts = each.point.segment != map.keyframes[i - 1].point.segment;
      if (!joint) {
        joint = MapStore::Joint{{last, frame, each.edge->T_last_new, each.edge->information, {}}, starts};
      } else {
        joint->edge.information =
            chained_information(joint->edge.information, each.edge->information, each.edge->T_last_new);
        joint->edge.T_from_to = normalised(joint->edge.T_from_to * each.edge->T_last_new);
        joint->starts_segment = joint->starts_segment || starts;
      }
      joint->edge.to = frame;
    }
    if (!stays[i]) {
      removed.push_back(frame);
      continue;
    }
    if (joint && i > 0 && !stays[i - 1]) {
      if (joint->starts_segment) joint->edge.information = no_information();
      joints.push_back(*joint);
    }
    joint.reset();
    last = frame;
  }
  if (removed.empty()) return false;
  if (const Status status = store.remove(removed, joints); !status) return status.error();
  return true;
}

}  // namespace revisit
