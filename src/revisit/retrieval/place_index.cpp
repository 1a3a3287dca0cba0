// SPDX-License-Identifier: Apache-2.0
#include <revisit/retrieval/place_index.hpp>

#include <algorithm>
#include <cstdlib>
#include <stdexcept>

#include <revisit/descriptors/similarity.hpp>
#include <revisit/retrieval/internal/nearest_images.hpp>

namespace revisit {
namespace {

// The largest distance whose score passes, as far as it follows from the distance alone.
std::uint32_t farthest_distance(double min_score, const DescriptorView& query) {
  if (query.levels > 0) return UINT32_MAX;
  const std::size_t cells = query.cells();
  auto distance = static_cast<std::uint32_t>((1.0 - min_score) * static_cast<double>(cells));
  while (distance < cells && geometry_score(query, query, distance + 1) >= min_score) ++distance;
  while (distance > 0 && geometry_score(query, query, distance) < min_score) --distance;
  return distance;
}

// Candidates in order; of those few frames apart, the first.
std::vector<LoopCandidate> best_apart(const std::vector<LoopCandidate>& sorted, std::size_t count, int separation) {
  std::vector<LoopCandidate> result;
  for (const LoopCandidate& each : sorted) {
    if (result.size() == count) break;
    const bool is_apart = std::none_of(result.begin(), result.end(), [&](const LoopCandidate& other) {
      return std::abs(each.match.value - other.match.value) <= separation;
    });
    if (is_apart) result.push_back(each);
  }
  return result;
}

// How many of the first `size` places pass a test that, once failed, fails for all later ones.
template <typename Test>
std::size_t prefix(std::size_t size, Test passes) {
  std::size_t begin = 0, end = size;
  while (begin < end) {
    const std::size_t middle = begin + (end - begin) / 2;
    passes(middle) ? begin = middle + 1 : end = middle;
  }
  return begin;
}

}  // namespace

PlaceIndex::PlaceIndex(const RetrievalOptions& options) : PlaceIndex(options, std::make_unique<Store>()) {}
PlaceIndex::PlaceIndex(const RetrievalOptions& options, std::unique_ptr<Store> store)
    : options_(options), store_(std::move(store)) {}
PlaceIndex::~PlaceIndex() = default;
PlaceIndex::PlaceIndex(PlaceIndex&&) noexcept = default;
PlaceIndex& PlaceIndex::operator=(PlaceIndex&&) noexcept = default;

void PlaceIndex::add(FrameId frame, double stamp_s, const IntensityScanContext& descriptor) {
  store_->add(frame, stamp_s, descriptor);
}

std::size_t PlaceIndex::size() const { return store_->size(); }

FrameId PlaceIndex::frame(std::size_t place) const { return store_->frame(place); }

// Frames increase and latest stamps do not decrease: the searchable past is the beginning of the index.
std::size_t PlaceIndex::searchable(const FrameTime& query) const {
  return prefix(store_->size(), [&](std::size_t i) {
    return options_.allows(query, {store_->frame(i), store_->latest_s(i)});
  });
}

std::size_t PlaceIndex::until(FrameId newest) const {
  return prefix(store_->size(), [&](std::size_t i) { return store_->frame(i) <= newest; });
}

Result<std::vector<LoopCandidate>> PlaceIndex::search(const IntensityScanContext& query, PlaceRange places, int threads,
                                                      SearchEffort* effort) const {
  if (places.size() > 0 &&
      (query.rings != store_->rings() || query.sectors != store_->sectors() || query.levels != store_->levels()))
    throw std::invalid_argument("descriptors of different grids cannot be compared");
  const auto shortlist = options_.shortlist == 0 ? places.size() : static_cast<std::size_t>(options_.shortlist);
  retrieval_internal::SearchCounts counts;
  const auto nearest =
      retrieval_internal::nearest_images(*store_, places, query.occupancy.data(), shortlist,
                                         farthest_distance(options_.min_geometry_score, query), threads, &counts);
  if (!nearest) return nearest.error();
  if (effort != nullptr) *effort = {counts.places, counts.compared};

  std::vector<LoopCandidate> candidates;
  candidates.reserve(nearest->size());
  for (const auto& each : *nearest) {
    LoopCandidate candidate;
    candidate.match = store_->frame(each.place);
    candidate.shift_columns = static_cast<int>(each.shift);
    candidate.yaw_rad = yaw_of_shift(candidate.shift_columns, query.sectors);
    const auto descriptor = store_->descriptor(each.place);
    if (!descriptor) return store_->damage(each.place);
    candidate.geometry_score = geometry_score(query, *descriptor, each.distance);
    candidate.intensity_score = match_intensity(query, *descriptor, candidate.shift_columns);
    if (candidate.geometry_score >= options_.min_geometry_score &&
        candidate.intensity_score >= options_.min_intensity_score)
      candidates.push_back(candidate);
  }
  const auto rank = [&](const LoopCandidate& each) {
    return each.geometry_score + options_.intensity_weight * each.intensity_score;
  };
  std::sort(candidates.begin(), candidates.end(), [&](const LoopCandidate& a, const LoopCandidate& b) {
    return rank(a) != rank(b) ? rank(a) > rank(b) : a.match < b.match;
  });
  return best_apart(candidates, static_cast<std::size_t>(options_.top_k), options_.separation_frames);
}

std::optional<DescriptorView> PlaceIndex::find(FrameId frame) const {
  const std::size_t size = store_->size();
  const std::size_t i = prefix(size, [&](std::size_t at) { return store_->frame(at) < frame; });
  if (i == size || store_->frame(i) != frame) return std::nullopt;
  return store_->descriptor(i);
}

Status PlaceIndex::save(const std::string& path) const { return store_->save(path); }
Status PlaceIndex::check() const { return store_->check(); }

Result<PlaceIndex> PlaceIndex::open(const std::string& path, const RetrievalOptions& options) {
  auto store = Store::open(path);
  if (!store) return store.error();
  return PlaceIndex(options, *std::move(store));
}

Status PlaceIndex::save(const WritePiece& write) const { return store_->save(write); }

Result<PlaceIndex> PlaceIndex::open(const std::string& name, std::size_t size, ReadPiece read,
                                    const RetrievalOptions& options) {
  auto store = Store::open(name, size, std::move(read));
  if (!store) return store.error();
  return PlaceIndex(options, *std::move(store));
}

}  // namespace revisit
