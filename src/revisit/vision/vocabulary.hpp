// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include <revisit/vision/image_features.hpp>

namespace revisit {

/// The words of an image with their weights, which sum to 1, in the order of the words.
using WordWeights = std::vector<std::pair<std::uint32_t, float>>;

/// A tree of binary words (Galvez-Lopez and Tardos, T-RO 2012): ten branches, four levels, made from images of other
/// drives by k-medians; a word weighs the more the fewer of those images hold it. Reading is safe from several threads.
class Vocabulary {
 public:
  explicit Vocabulary(std::span<const std::vector<BinaryFeature>> images);

  std::size_t words() const { return weights_.size(); }
  WordWeights words_of(const std::vector<BinaryFeature>& features) const;

 private:
  struct Node {
    BinaryFeature::Bits bits{};
    std::uint32_t first_child = 0, children = 0;  ///< none: a word
    std::uint32_t word = 0;
  };
  void grow(std::uint32_t node, std::vector<BinaryFeature::Bits> of_node, int levels);
  std::uint32_t word_of(const BinaryFeature::Bits& bits) const;

  std::vector<Node> nodes_;
  std::vector<float> weights_;
};

/// How alike two images are, in [0, 1] (L1, equation 2 of the paper).
double similarity(const WordWeights& a, const WordWeights& b);

}  // namespace revisit
