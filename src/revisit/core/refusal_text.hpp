// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <revisit/core/refusal.hpp>
#include <revisit/core/text.hpp>

namespace revisit {

/// The refusal as people read it in candidates.csv: what was measured, and the bound. Holds no comma.
inline std::string to_text(const Refusal& refusal) {
  using Reason = Refusal::Reason;
  const double value = refusal.value, limit = refusal.limit;
  switch (refusal.reason) {
    case Reason::kNoSearchablePast:
      return "no searchable past";
    case Reason::kNoCandidate:
      return "no similar place";
    case Reason::kNoPose:
      return "retrieval only: no pose to verify";
    case Reason::kElsewhere:
      return format("%.0f m away by odometry: more than %.0f m", value, limit);
    case Reason::kOtherHeading:
      return format("turned by %.0f deg against odometry: more than %.0f deg", value, limit);
    case Reason::kLowOverlap:
      return format("overlap seen from overhead %.2f below %.2f", value, limit);
    case Reason::kTemporallyInconsistent:
      return format("temporal consistency %.3f below %.3f", value, limit);
    case Reason::kFewInliers:
      return format("inlier ratio %.2f below %.2f", value, limit);
    case Reason::kSlides:
      return format("position uncertain by %.2f m: more than %.2f m", value, limit);
    case Reason::kImprobable:
      return format("probability %.3f below %.3f", value, limit);
    case Reason::kOneView:
      return "probability " + format("%.3f", value) + " by one scan of a narrow view or a room: a drive is needed";
    case Reason::kTooFar:
      return format("translation %.1f m above %.1f m", value, limit);
  }
  return "unknown";
}

}  // namespace revisit
