// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <revisit/core/ids.hpp>

namespace revisit {

/// A scan as the exclusion of the recent past sees it.
struct FrameTime {
  FrameId frame;
  double stamp_s = 0.0;
};

/// Which places are too recent to answer a query (docs/evaluation.md, "Who may be matched"): those fewer frames or
/// fewer seconds before it. A recording without times has 0 seconds here: its frames alone decide.
struct ExclusionRule {
  int exclude_frames = 50;
  double exclude_s = 30.0;

  bool allows(const FrameTime& query, const FrameTime& place) const {
    // "30 s before" must hold for times that were rounded to microseconds.
    constexpr double kTolerance_s = 1e-6;
    return query.frame.value - place.frame.value >= exclude_frames &&
           query.stamp_s - place.stamp_s >= exclude_s - kTolerance_s;
  }
};

}  // namespace revisit
