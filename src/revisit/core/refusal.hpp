// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

namespace revisit {

/// Why a query has no loop, or a candidate is none. Words for it: core/refusal_text.hpp.
struct Refusal {
  enum class Reason : std::uint8_t {
    kNoSearchablePast,        ///< every place is too recent
    kNoCandidate,             ///< no place passed the thresholds of retrieval
    kNoPose,                  ///< the method retrieves only: there is nothing to verify
    kElsewhere,               ///< by odometry, metres
    kOtherHeading,            ///< than by odometry, degrees
    kLowOverlap,              ///< seen from overhead
    kTemporallyInconsistent,  ///< the frames before do not match (eq. 11)
    kFewInliers,
    kSlides,  ///< the surfaces hardly fix the position along one direction: its standard deviation, metres
    kImprobable,
    kOneView,  ///< by one scan of a sector or of a room, which may be another street's or another room's
    kTooFar,   ///< the relative translation
  };
  Reason reason = Reason::kNoCandidate;
  double value = 0.0, limit = 0.0;  ///< what was measured, and the bound that it missed; 0 where there is none
};

}  // namespace revisit
