// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include <revisit/core/candidate_row.hpp>
#include <revisit/core/exclusion.hpp>
#include <revisit/vision/vocabulary.hpp>

namespace revisit {

/// Places by the words of their images, as DBoW2 finds them (Galvez-Lopez and Tardos, T-RO 2012): the most similar
/// image, its similarity divided by that to the image just before, which is as much as can be expected (equation 3).
/// Its checks over time and of geometry are left out: what is scored is retrieval. Belongs to one thread at a time.
class VisualWords {
 public:
  VisualWords(std::shared_ptr<const Vocabulary> vocabulary, const ExclusionRule& exclusion)
      : vocabulary_(std::move(vocabulary)), exclusion_(exclusion) {}

  /// None where no image is old enough. Frames increase. Every answer counts as refused: there is no threshold.
  std::optional<CandidateRow> process(const FrameTime& query, const Image& image);

  std::size_t bytes_a_place() const { return places_.empty() ? 0 : bytes_ / places_.size(); }

 private:
  struct Place {
    FrameTime frame;
    WordWeights words;
  };
  std::shared_ptr<const Vocabulary> vocabulary_;
  ExclusionRule exclusion_;
  std::vector<Place> places_;
  std::size_t bytes_ = 0;
};

/// A vocabulary from the images given, with the same features.
std::shared_ptr<const Vocabulary> make_vocabulary(const std::vector<Image>& images);

}  // namespace revisit
