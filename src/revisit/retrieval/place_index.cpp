// SPDX-License-Identifier: Apache-2.0
#include <revisit/retrieval/place_index.hpp>

#include <algorithm>
#include <stdexcept>
#include <string>

#include <revisit/descriptors/similarity.hpp>

namespace revisit {
namespace {

// A hair of tolerance, so that "30 s before" holds for times that were rounded to microseconds.
constexpr double kTimeTolerance_s = 1e-6;

}  // namespace

void PlaceIndex::add(FrameId frame, double stamp_s, IntensityScanContext descriptor) {
  if (!places_.empty()) {
    if (frame <= places_.back().frame)
      throw std::invalid_argument("frame " + std::to_string(frame.value) + " after frame " +
                                  std::to_string(places_.back().frame.value) + ": frames must increase");
    const IntensityScanContext& first = places_.front().descriptor;
    if (descriptor.rings != first.rings || descriptor.sectors != first.sectors)
      throw std::invalid_argument("descriptors of one index must have one grid");
  }
  places_.push_back({frame, stamp_s, std::move(descriptor)});
}

bool PlaceIndex::may_match(const Place& place, FrameId frame, double stamp_s) const {
  return frame.value - place.frame.value >= options_.exclude_frames &&
         stamp_s - place.stamp_s >= options_.exclude_s - kTimeTolerance_s;
}

bool PlaceIndex::has_searchable_past(FrameId frame, double stamp_s) const {
  return std::any_of(places_.begin(), places_.end(),
                     [&](const Place& place) { return may_match(place, frame, stamp_s); });
}

std::vector<LoopCandidate> PlaceIndex::search(FrameId frame, double stamp_s, const IntensityScanContext& query) const {
  std::vector<const Place*> allowed;
  for (const Place& place : places_)
    if (may_match(place, frame, stamp_s)) allowed.push_back(&place);
  return rank(allowed, query);
}

std::vector<LoopCandidate> PlaceIndex::search_all(const IntensityScanContext& query) const {
  std::vector<const Place*> all;
  for (const Place& place : places_) all.push_back(&place);
  return rank(all, query);
}

std::vector<LoopCandidate> PlaceIndex::rank(const std::vector<const Place*>& places,
                                            const IntensityScanContext& query) const {
  struct Geometry {
    const Place* place;
    GeometryMatch match;
  };
  std::vector<Geometry> shortlist;
  for (const Place* place : places) {
    const GeometryMatch match = match_geometry(query, place->descriptor);
    if (match.score >= options_.min_geometry_score) shortlist.push_back({place, match});
  }
  const auto limit = static_cast<std::size_t>(options_.shortlist);
  if (limit != 0 && shortlist.size() > limit) {
    std::stable_sort(shortlist.begin(), shortlist.end(),
                     [](const Geometry& a, const Geometry& b) { return a.match.score > b.match.score; });
    shortlist.resize(limit);
  }
  std::vector<LoopCandidate> candidates;
  for (const Geometry& each : shortlist) {
    LoopCandidate candidate;
    candidate.match = each.place->frame;
    candidate.geometry_score = each.match.score;
    candidate.shift_columns = each.match.shift_columns;
    candidate.yaw_rad = yaw_of_shift(each.match.shift_columns, query.sectors);
    candidate.intensity_score = match_intensity(query, each.place->descriptor, each.match.shift_columns);
    if (candidate.intensity_score >= options_.min_intensity_score) candidates.push_back(candidate);
  }
  std::sort(candidates.begin(), candidates.end(), [](const LoopCandidate& a, const LoopCandidate& b) {
    return a.score() != b.score() ? a.score() > b.score() : a.match < b.match;
  });
  candidates.resize(std::min(candidates.size(), static_cast<std::size_t>(options_.top_k)));
  return candidates;
}

const IntensityScanContext* PlaceIndex::find(FrameId frame) const {
  const auto place = std::lower_bound(places_.begin(), places_.end(), frame,
                                      [](const Place& each, FrameId id) { return each.frame < id; });
  return place != places_.end() && place->frame == frame ? &place->descriptor : nullptr;
}

}  // namespace revisit
