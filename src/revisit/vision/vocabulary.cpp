// SPDX-License-Identifier: Apache-2.0
#include <revisit/vision/vocabulary.hpp>

#include <algorithm>
#include <cmath>
#include <map>
#include <random>
#include <set>

namespace revisit {
namespace {

constexpr std::size_t kBranches = 10;
constexpr int kLevels = 4, kRounds = 8;

using Bits = BinaryFeature::Bits;

std::size_t nearest_of(std::span<const Bits> centres, const Bits& bits) {
  std::size_t best = 0;
  for (std::size_t i = 1; i < centres.size(); ++i)
    if (hamming(centres[i], bits) < hamming(centres[best], bits)) best = i;
  return best;
}

// Each bit as most of them have it.
Bits median_of(const std::vector<Bits>& all) {
  Bits median{};
  for (std::size_t word = 0; word < median.size(); ++word)
    for (unsigned bit = 0; bit < 64; ++bit) {
      const auto ones =
          std::count_if(all.begin(), all.end(), [&](const Bits& b) { return (b[word] >> bit & 1u) != 0; });
      if (2 * static_cast<std::size_t>(ones) > all.size()) median[word] |= std::uint64_t{1} << bit;
    }
  return median;
}

std::vector<std::vector<Bits>> split(const std::vector<Bits>& all, std::vector<Bits>& centres) {
  std::mt19937 random(1);
  centres = {all[random() % all.size()]};
  // Each further one far from those there are (k-means++).
  while (centres.size() < std::min(kBranches, all.size())) {
    std::vector<double> odds;
    odds.reserve(all.size());
    for (const Bits& bits : all) odds.push_back(std::pow(hamming(centres[nearest_of(centres, bits)], bits), 2));
    if (*std::max_element(odds.begin(), odds.end()) == 0.0) break;  // all are among them
    centres.push_back(all[std::discrete_distribution<std::size_t>(odds.begin(), odds.end())(random)]);
  }
  std::vector<std::vector<Bits>> parts;
  for (int round = 0; round < kRounds; ++round) {
    parts.assign(centres.size(), {});
    for (const Bits& bits : all) parts[nearest_of(centres, bits)].push_back(bits);
    if (round + 1 == kRounds) break;
    for (std::size_t i = 0; i < centres.size(); ++i)
      if (!parts[i].empty()) centres[i] = median_of(parts[i]);
  }
  return parts;
}

}  // namespace

Vocabulary::Vocabulary(std::span<const std::vector<BinaryFeature>> images) {
  std::vector<Bits> all;
  for (const auto& image : images)
    for (const BinaryFeature& feature : image) all.push_back(feature.bits);
  nodes_.emplace_back();
  grow(0, std::move(all), kLevels);
  std::vector<std::size_t> images_with(weights_.size());
  for (const auto& image : images) {
    std::set<std::uint32_t> words;
    for (const BinaryFeature& feature : image) words.insert(word_of(feature.bits));
    for (const std::uint32_t word : words) ++images_with[word];
  }
  for (std::size_t word = 0; word < weights_.size(); ++word)
    weights_[word] = static_cast<float>(
        std::log(static_cast<double>(images.size() + 1) / static_cast<double>(images_with[word] + 1)));
}

void Vocabulary::grow(std::uint32_t node, std::vector<Bits> of_node, int levels) {
  if (levels == 0 || of_node.size() <= 1) {
    nodes_[node].word = static_cast<std::uint32_t>(weights_.size());
    weights_.push_back(0.f);
    return;
  }
  std::vector<Bits> centres;
  std::vector<std::vector<Bits>> parts = split(of_node, centres);
  of_node = {};  // not kept while the branches grow
  const auto first = static_cast<std::uint32_t>(nodes_.size());
  nodes_[node].first_child = first;
  nodes_[node].children = static_cast<std::uint32_t>(centres.size());
  for (const Bits& centre : centres) nodes_.push_back({centre, 0, 0, 0});
  for (std::size_t i = 0; i < parts.size(); ++i)
    grow(first + static_cast<std::uint32_t>(i), std::move(parts[i]), levels - 1);
}

std::uint32_t Vocabulary::word_of(const Bits& bits) const {
  std::uint32_t node = 0;
  while (nodes_[node].children > 0) {
    std::uint32_t best = nodes_[node].first_child;
    for (std::uint32_t i = 1; i < nodes_[node].children; ++i) {
      const std::uint32_t child = nodes_[node].first_child + i;
      if (hamming(nodes_[child].bits, bits) < hamming(nodes_[best].bits, bits)) best = child;
    }
    node = best;
  }
  return nodes_[node].word;
}

WordWeights Vocabulary::words_of(const std::vector<BinaryFeature>& features) const {
  std::map<std::uint32_t, float> words;
  float sum = 0.f;
  for (const BinaryFeature& feature : features) {
    const std::uint32_t word = word_of(feature.bits);
    words[word] += weights_[word];
    sum += weights_[word];
  }
  WordWeights weights;
  for (const auto& [word, weight] : words)
    if (weight > 0.f) weights.emplace_back(word, weight / sum);
  return weights;
}

double similarity(const WordWeights& a, const WordWeights& b) {
  double common = 0.0;
  for (auto i = a.begin(), j = b.begin(); i != a.end() && j != b.end();) {
    if (i->first == j->first)
      common += static_cast<double>(std::min((i++)->second, (j++)->second));
    else if (i->first < j->first)
      ++i;
    else
      ++j;
  }
  return common;
}

}  // namespace revisit
