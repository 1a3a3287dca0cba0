// SPDX-License-Identifier: Apache-2.0
#include <revisit/vision/visual_words.hpp>

#include <algorithm>

#include <revisit/core/refusal_text.hpp>

namespace revisit {
namespace {

constexpr FeatureOptions kFeatures{};
constexpr double kLeastExpected = 0.02;  // pictures of nothing, one after the other, tell nothing

}  // namespace

std::shared_ptr<const Vocabulary> make_vocabulary(const std::vector<Image>& images) {
  std::vector<std::vector<BinaryFeature>> features;
  features.reserve(images.size());
  for (const Image& image : images) features.push_back(find_features(image, kFeatures));
  return std::make_shared<const Vocabulary>(features);
}

std::optional<CandidateRow> VisualWords::process(const FrameTime& query, const Image& image) {
  Place place{query, vocabulary_->words_of(find_features(image, kFeatures))};
  const auto too_recent = std::partition_point(places_.begin(), places_.end(),
                                               [&](const Place& each) { return exclusion_.allows(query, each.frame); });
  std::optional<CandidateRow> row;
  if (too_recent != places_.begin()) {
    row.emplace();
    row->query = query.frame;
    double best = 0.0;
    for (auto each = places_.begin(); each != too_recent; ++each)
      if (const double alike = similarity(place.words, each->words); alike > best)
        best = alike, row->match = each->frame.frame;
    row->score = best / std::max(kLeastExpected, similarity(place.words, places_.back().words));
    row->reason = to_text(Refusal{row->match ? Refusal::Reason::kNoPose : Refusal::Reason::kNoCandidate});
  }
  bytes_ += place.words.size() * sizeof(WordWeights::value_type);
  places_.push_back(std::move(place));
  return row;
}

}  // namespace revisit
