// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include <revisit/core/loop.hpp>
#include <revisit/evaluation/reference.hpp>

namespace revisit {

/// An accepted loop beside the truth.
struct JudgedLoop {
  FrameId query, match;
  double translation_error_m = 0.0, rotation_error_deg = 0.0;
  bool right = false;  ///< within right_translation_m and right_rotation_deg; otherwise a false loop
};

/// Table 2: what a SLAM user gets at the shipped threshold.
struct LoopTable {
  std::size_t revisits = 0, reverse_revisits = 0;
  std::size_t accepted = 0, false_loops = 0;
  std::size_t without_reference = 0;          ///< accepted loops that cannot be judged; in no other figure
  double precision = 1.0;                     ///< 1 where nothing was accepted
  double recall = 0.0, reverse_recall = 0.0;  ///< revisits with a right accepted loop
  double median_translation_m = 0.0, p95_translation_m = 0.0;
  double median_rotation_deg = 0.0, p95_rotation_deg = 0.0;
  std::vector<JudgedLoop> loops;
};

LoopTable evaluate_loops(const std::vector<LoopConstraint>& loops, const Reference& reference);

}  // namespace revisit
