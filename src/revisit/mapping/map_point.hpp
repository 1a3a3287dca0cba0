// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

namespace revisit {

/// A point of a map, and when it was seen: what a viewer colours it by.
struct MapPoint {
  float x = 0.f, y = 0.f, z = 0.f;  ///< metres, in the map's frame
  float intensity = 0.f;            ///< [0, 1]
  std::uint16_t session = 0;        ///< that saw it first
  std::uint16_t time = 0;           ///< of the key frame that saw it first: 0 for the map's first, 65535 for its last
};

}  // namespace revisit
