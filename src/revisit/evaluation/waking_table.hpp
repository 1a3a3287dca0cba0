// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <vector>

#include <revisit/core/localisation_row.hpp>
#include <revisit/evaluation/reference.hpp>

namespace revisit {

/// Table 5: waking up in a saved map, and following in it (docs/evaluation.md).
struct WakingTable {
  std::size_t scans = 0;
  std::size_t in_map = 0;         ///< within 4 m of a key frame of the map
  std::size_t right = 0;          ///< of these, answered within 0.5 m and 3 degrees
  std::size_t outside = 0;        ///< farther than 25 m from all of them: places that the map does not hold
  std::size_t answered = 0;       ///< of all scans
  std::size_t false_answers = 0;  ///< answers that are not right, wherever the scan is
  std::size_t false_outside = 0;  ///< of these, outside
  double median_error_m = 0.0, p95_error_m = 0.0, median_error_deg = 0.0;  ///< of right answers
  double median_ms = 0.0, p99_ms = 0.0;
  std::map<std::string, std::size_t> statuses;
  std::vector<FrameId> false_frames;

  double share() const { return in_map == 0 ? 0.0 : static_cast<double>(right) / static_cast<double>(in_map); }
};

/// `queries`: true poses of the scans; `keyframes`: true poses of the map's key frames (in_map()), in the same world.
/// An answer is judged by its pose relative to the key frame that it names: errors of the map itself do not count.
WakingTable evaluate_waking(const std::vector<LocalisationRow>& rows, const Trajectory& queries,
                            const std::map<FrameId, Pose>& keyframes, const EvaluationRules& rules);

}  // namespace revisit
