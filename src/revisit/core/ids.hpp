// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <compare>
#include <cstdint>

namespace revisit {

/// The number of a scan in its recording (KITTI: the number in the file's name). Gaps are allowed.
struct FrameId {
  std::int64_t value = 0;
  auto operator<=>(const FrameId&) const = default;
};

}  // namespace revisit
