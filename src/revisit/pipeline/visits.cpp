// SPDX-License-Identifier: Apache-2.0
#include <revisit/pipeline/visits.hpp>

#include <algorithm>
#include <deque>
#include <map>

#include <revisit/mapping/map_changes.hpp>
#include <revisit/store/keyframe_bytes.hpp>

namespace revisit {
namespace {

struct Comparing {
  static constexpr double kNear_m = 8.0;         ///< visits of a place
  static constexpr std::size_t kMostVisits = 8;  ///< the nearest of them
  static constexpr std::size_t kKept = 64;       ///< clouds in memory
};

// What key frames of the session at work saw; of the last few, in memory.
class VisitClouds {
 public:
  explicit VisitClouds(const MapStore& store) : store_(store) {}

  Result<const std::vector<Point>*> get(FrameId frame) {
    if (const auto found = clouds_.find(frame); found != clouds_.end()) return &found->second;
    auto points = read(frame);
    if (!points) return points.error();
    if (order_.size() == Comparing::kKept) {
      clouds_.erase(order_.front());
      order_.pop_front();
    }
    order_.push_back(frame);
    return &(clouds_[frame] = *std::move(points));
  }

 private:
  Result<std::vector<Point>> read(FrameId frame) const {
    const auto visit = store_.part(frame, MapStore::Part::kVisit);
    if (!visit) return visit.error();
    if (visit->empty()) return read_map_points(store_, frame);  // it became a place
    auto points = to_map_points(*visit);
    if (!points) return store_.damaged("visit", frame);
    return *std::move(points);
  }

  const MapStore& store_;
  std::map<FrameId, std::vector<Point>> clouds_;
  std::deque<FrameId> order_;
};

struct Visitor {
  FrameId frame;
  int part = 0;
  Eigen::Vector3d at_m = Eigen::Vector3d::Zero();
};

// The key frames nearest to a place, of those in its part.
std::vector<FrameId> visits_near(const KeyframeGraph& graph, const std::vector<Visitor>& visitors, FrameId place) {
  const Eigen::Vector3d at_m = graph.T_world_lidar(place).translation();
  const int part = graph.part(place);
  std::vector<std::pair<double, FrameId>> near;
  for (const Visitor& each : visitors)
    if (const double distance2_m2 = (each.at_m - at_m).squaredNorm();
        distance2_m2 < Comparing::kNear_m * Comparing::kNear_m && each.part == part)
      near.emplace_back(distance2_m2, each.frame);
  std::sort(near.begin(), near.end());
  near.resize(std::min(near.size(), Comparing::kMostVisits));
  std::vector<FrameId> frames;
  frames.reserve(near.size());
  for (const auto& [distance2_m2, frame] : near) frames.push_back(frame);
  return frames;
}

Status compare_place(MapStore& store, const KeyframeGraph& graph, VisitClouds& clouds, FrameId place,
                     const std::vector<FrameId>& visitors, int session) {
  auto stored = read_place_points(store, place);
  if (!stored) return stored.error();
  if (stored->compared_with >= session) return ok();
  std::vector<Visit> visits;
  visits.reserve(visitors.size());
  for (const FrameId each : visitors) {
    const auto points = clouds.get(each);
    if (!points) return points.error();
    visits.push_back({graph.T_world_lidar(each), **points});
  }
  PlacePoints points{graph.T_world_lidar(place), std::move(stored->points), std::move(stored->history)};
  if (!update_place(points, visits, session)) return ok();
  return write_place_points(store, place, {std::move(points.points), std::move(points.history), session});
}

}  // namespace

Status compare_with_visits(MapStore& store, const KeyframeGraph& graph, int session) {
  const auto visits = store.visits();
  if (!visits) return visits.error();
  if (visits->empty()) return ok();
  const auto places = store.places();
  if (!places) return places.error();
  // Those that a run left which was never finished are not this session's.
  std::vector<Visitor> visitors;
  for (const std::vector<FrameId>* frames : {&*visits, &*places})
    for (const FrameId each : *frames)
      if (session_of(each) == session && graph.has(each))
        visitors.push_back({each, graph.part(each), graph.T_world_lidar(each).translation()});
  VisitClouds clouds(store);
  for (const FrameId place : *places) {
    if (session_of(place) == session || !graph.has(place)) continue;
    const std::vector<FrameId> near = visits_near(graph, visitors, place);
    if (near.size() < 2) continue;
    if (Status compared = compare_place(store, graph, clouds, place, near, session); !compared) return compared;
  }
  return store.forget_visits();
}

}  // namespace revisit
