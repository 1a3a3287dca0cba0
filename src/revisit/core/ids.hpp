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

/// A map holds sessions: recordings that entered it one after the other, numbered from 0. Its key frames carry their
/// session in the upper bits of their number; in the first session they have the numbers of their recording.
inline constexpr int kFrameBits = 40;

/// `frame` of a recording, 0 to 2^40 - 1, as the map numbers it.
inline FrameId in_map(int session, FrameId frame) { return {(std::int64_t{session} << kFrameBits) | frame.value}; }
inline int session_of(FrameId frame) { return static_cast<int>(frame.value >> kFrameBits); }
inline FrameId in_recording(FrameId frame) { return {frame.value & ((std::int64_t{1} << kFrameBits) - 1)}; }
/// Whether a recording's number has room beside the session's.
inline bool fits_into_map(FrameId frame) { return frame.value >= 0 && session_of(frame) == 0; }

}  // namespace revisit
