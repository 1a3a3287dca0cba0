// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

namespace revisit {

/// Places of an index by the order in which they were added: [first, last). A number alone: the first so many.
struct PlaceRange {
  std::size_t first = 0, last = 0;

  PlaceRange(std::size_t count) : last(count) {}
  PlaceRange(std::size_t first_place, std::size_t last_place) : first(first_place), last(last_place) {}
  std::size_t size() const { return last > first ? last - first : 0; }
};

}  // namespace revisit
