// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include <revisit/retrieval/internal/place_store.hpp>
#include <revisit/retrieval/place_range.hpp>

namespace revisit::retrieval_internal {

/// A place by its distance to the query: differing cells at the best shift. Ordered by distance, then by age.
struct NearImage {
  std::uint32_t distance = 0;
  std::uint32_t shift = 0;
  std::uint64_t place = 0;
  bool operator<(const NearImage& other) const {
    return distance != other.distance ? distance < other.distance : place < other.place;
  }
};

struct SearchCounts {
  std::size_t places = 0;    ///< that were to be searched
  std::size_t compared = 0;  ///< whose images were looked at; the rest was excluded by its bound
};

/// The `count` nearest of these places, at most `farthest` away, nearest first: exactly those that
/// comparing all would give. `threads` share the work. Allocates nothing but the result once its thread has searched
/// before. An error where the store lies in a file that was altered.
Result<std::vector<NearImage>> nearest_images(const PlaceStore& store, PlaceRange places, const std::uint64_t* query,
                                              std::size_t count, std::uint32_t farthest, int threads = 1,
                                              SearchCounts* counts = nullptr);

}  // namespace revisit::retrieval_internal
