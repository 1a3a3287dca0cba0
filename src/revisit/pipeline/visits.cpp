// SPDX-License-Identifier: Apache-2.0
#include <revisit/pipeline/visits.hpp>

#include <algorithm>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include <oneapi/tbb/parallel_for.h>

#include <revisit/mapping/map_changes.hpp>
#include <revisit/store/keyframe_bytes.hpp>

namespace revisit {
namespace {

struct Comparing {
  static constexpr double kNear_m = 8.0;         ///< visits of a place
  static constexpr std::size_t kMostVisits = 8;  ///< the nearest of them
  static constexpr std::size_t kKept = 64;       ///< clouds in memory
  static constexpr std::size_t kAtOnce = 32;     ///< places
};

// What key frames of the session at work saw; of the last few, in memory.
class VisitClouds {
 public:
  explicit VisitClouds(const MapStore& store) : store_(store) {}

  Result<std::shared_ptr<const SeenFromKeyframe>> get(FrameId frame) {
    if (const auto found = seen_.find(frame); found != seen_.end()) return found->second;
    auto points = read(frame);
    if (!points) return points.error();
    if (order_.size() == Comparing::kKept) {
      seen_.erase(order_.front());
      order_.pop_front();
    }
    order_.push_back(frame);
    return seen_[frame] = std::make_shared<const SeenFromKeyframe>(*std::move(points));
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
  std::map<FrameId, std::shared_ptr<const SeenFromKeyframe>> seen_;
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

// A place and what is compared with it.
struct Comparison {
  FrameId frame;
  PlacePoints place;
  std::vector<Visit> visits;
  bool is_changed = false;
};

// Nothing where it was compared already.
Result<std::optional<Comparison>> read_comparison(const MapStore& store, const KeyframeGraph& graph,
                                                  VisitClouds& clouds, FrameId place,
                                                  const std::vector<FrameId>& visitors, int session) {
  auto stored = read_place_points(store, place);
  if (!stored) return stored.error();
  if (stored->compared_with >= session) return std::optional<Comparison>();
  std::optional<Comparison> read(std::in_place);
  read->frame = place;
  read->place = {graph.T_world_lidar(place), std::move(stored->points), std::move(stored->history)};
  read->visits.reserve(visitors.size());
  for (const FrameId each : visitors) {
    auto seen = clouds.get(each);
    if (!seen) return seen.error();
    read->visits.push_back({graph.T_world_lidar(each), *std::move(seen)});
  }
  return read;
}

// Places change on their own, in parallel; they are written in their order.
Status compare(MapStore& store, std::vector<Comparison>& comparisons, int session) {
  tbb::parallel_for(std::size_t{0}, comparisons.size(), [&](std::size_t i) {
    comparisons[i].is_changed = update_place(comparisons[i].place, comparisons[i].visits, session);
  });
  for (Comparison& each : comparisons) {
    if (!each.is_changed) continue;
    PlacePoints& points = each.place;
    if (Status written =
            write_place_points(store, each.frame, {std::move(points.points), std::move(points.history), session});
        !written)
      return written;
  }
  comparisons.clear();
  return ok();
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
  std::vector<Comparison> comparisons;
  for (const FrameId place : *places) {
    if (session_of(place) == session || !graph.has(place)) continue;
    const std::vector<FrameId> near = visits_near(graph, visitors, place);
    if (near.size() < 2) continue;
    auto read = read_comparison(store, graph, clouds, place, near, session);
    if (!read) return read.error();
    if (*read) comparisons.push_back(**std::move(read));
    if (comparisons.size() < Comparing::kAtOnce) continue;
    if (Status compared = compare(store, comparisons, session); !compared) return compared;
  }
  if (Status compared = compare(store, comparisons, session); !compared) return compared;
  return store.forget_visits();
}

}  // namespace revisit
