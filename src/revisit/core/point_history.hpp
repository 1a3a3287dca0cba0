// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

namespace revisit {

/// A point of the map through the sessions that passed by.
struct PointHistory {
  static constexpr std::uint16_t kNever = UINT16_MAX;
  std::uint16_t since = 0;      ///< the session that saw it first
  std::uint16_t gone = kNever;  ///< the session after which it was no longer part of the map
  std::uint8_t missed = 0;      ///< visits in a row that looked there and saw through it

  bool is_in_map() const { return gone == kNever; }
  bool was_in_map(int session) const { return since <= session && session < gone; }
};

}  // namespace revisit
