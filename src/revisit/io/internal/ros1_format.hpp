// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string_view>

namespace revisit::io_internal::ros1 {

// Bag format 2.0: records of a header (fields "name=value") and data, both preceded by their length.
constexpr std::string_view kMagic = "#ROSBAG V2.0\n";
enum Op : std::uint8_t { kMessage = 2, kBagHeader = 3, kIndex = 4, kChunk = 5, kChunkInfo = 6, kConnection = 7 };

}  // namespace revisit::io_internal::ros1
