// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string_view>

namespace revisit::io_internal::mcap {

// mcap.dev/spec: records of an opcode, the length of their content (uint64), and the content.
constexpr std::string_view kMagic{"\x89MCAP0\r\n", 8};
constexpr std::uint64_t kRecordHead = 9;
enum Op : std::uint8_t {
  kHeader = 1,
  kFooter = 2,
  kSchema = 3,
  kChannel = 4,
  kMessage = 5,
  kChunk = 6,
  kMessageIndex = 7,
  kChunkIndex = 8,
  kStatistics = 11,
  kDataEnd = 15
};

}  // namespace revisit::io_internal::mcap
