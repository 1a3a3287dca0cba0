// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

namespace revisit {

/// A grey image, row by row from the top left.
struct Image {
  int width = 0, height = 0;
  std::vector<std::uint8_t> grey;
};

}  // namespace revisit
