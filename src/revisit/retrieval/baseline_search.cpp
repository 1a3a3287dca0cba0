// SPDX-License-Identifier: Apache-2.0
#include <revisit/retrieval/baseline_search.hpp>

#include <algorithm>
#include <numeric>

#include <oneapi/tbb/parallel_for.h>

#include <revisit/core/refusal_text.hpp>

namespace revisit {

std::vector<std::size_t> BaselineSearch::shortlist(const Place& query, std::size_t searchable) const {
  const std::size_t every = method_->place_every(), places = (searchable + every - 1) / every;
  std::vector<std::size_t> chosen;
  if (index_)
    chosen = index_->look_up(query.signature, places);
  else
    chosen.resize(places), std::iota(chosen.begin(), chosen.end(), std::size_t{0});
  for (std::size_t& place : chosen) place *= every;
  const std::size_t wanted = index_ ? 0 : method_->nearest_keys();
  if (wanted == 0 || places <= wanted) return chosen;
  std::vector<float> distance(searchable);
  for (const std::size_t i : chosen) distance[i] = (places_[i].key - query.key).squaredNorm();
  std::partial_sort(
      chosen.begin(), chosen.begin() + static_cast<std::ptrdiff_t>(wanted), chosen.end(),
      [&](std::size_t a, std::size_t b) { return distance[a] != distance[b] ? distance[a] < distance[b] : a < b; });
  chosen.resize(wanted);
  return chosen;
}

BaselineSearch::Answer BaselineSearch::answer(const Place& query, std::size_t searchable) const {
  const std::vector<std::size_t> compared = shortlist(query, searchable);
  std::vector<double> similarity(compared.size());
  tbb::parallel_for(std::size_t{0}, compared.size(), [&](std::size_t i) {
    similarity[i] = method_->similarity(query.signature, places_[compared[i]].signature);
  });
  const auto best = std::max_element(similarity.begin(), similarity.end());
  Answer answer;
  answer.row.query = query.frame.frame;
  if (best == similarity.end() || !(*best > method_->least_similarity())) {
    answer.row.reason = to_text(Refusal{Refusal::Reason::kNoCandidate});
    return answer;
  }
  const Place& match = places_[compared[static_cast<std::size_t>(best - similarity.begin())]];
  answer.row.match = match.frame.frame;
  answer.row.score = *best;
  answer.row.reason = to_text(Refusal{Refusal::Reason::kNoPose});
  answer.T_match_query = method_->T_place_query(query.signature, match.signature);
  return answer;
}

std::optional<double> BaselineSearch::similarity_to(FrameId frame) const {
  const auto found = std::lower_bound(places_.begin(), places_.end(), frame,
                                      [](const Place& place, FrameId of) { return place.frame.frame < of; });
  if (found == places_.end() || found->frame.frame != frame) return std::nullopt;
  return method_->similarity(last_, found->signature);
}

std::optional<BaselineSearch::Answer> BaselineSearch::process(const FrameTime& query_frame,
                                                              std::span<const Point> points, double ground_z_m) {
  Place query;
  query.frame = query_frame;
  if (!places_.empty()) query.frame.stamp_s = std::max(query_frame.stamp_s, places_.back().frame.stamp_s);
  query.signature = method_->describe(points, ground_z_m);
  query.key = method_->key(query.signature);

  const auto too_recent = std::partition_point(
      places_.begin(), places_.end(), [&](const Place& place) { return exclusion_.allows(query_frame, place.frame); });
  const auto searchable = static_cast<std::size_t>(too_recent - places_.begin());
  const auto found = searchable > 0 ? std::optional(answer(query, searchable)) : std::nullopt;
  last_ = query.signature;
  query.signature = method_->kept(std::move(query.signature));
  bytes_ += query.signature.bytes() + static_cast<std::size_t>(query.key.size()) * sizeof(float);
  places_.push_back(std::move(query));
  if (index_ && (places_.size() - 1) % method_->place_every() == 0) index_->add(places_.back().signature);
  return found;
}

}  // namespace revisit
