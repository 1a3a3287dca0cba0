// SPDX-License-Identifier: Apache-2.0
#include <revisit/evaluation/waking_table.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

#include <revisit/evaluation/internal/percentile.hpp>

namespace revisit {
namespace {

using evaluation_internal::percentile;

constexpr double kOutside_m = 25.0;

}  // namespace

WakingTable evaluate_waking(const std::vector<LocalisationRow>& rows, const Trajectory& queries,
                            const std::map<FrameId, Pose>& keyframes, const EvaluationRules& rules) {
  WakingTable table;
  std::vector<double> errors_m, errors_deg, ms;
  for (const LocalisationRow& row : rows) {
    const auto truth = queries.at(row.frame);
    if (!truth) continue;
    ++table.scans;
    ++table.statuses[row.status];
    ms.push_back(row.ms);
    double nearest_m = std::numeric_limits<double>::infinity();
    for (const auto& [frame, T_world_keyframe] : keyframes)
      nearest_m = std::min(nearest_m, (T_world_keyframe.translation() - truth->translation()).norm());
    const bool is_in_map = nearest_m <= rules.same_place_m, is_outside = nearest_m > kOutside_m;
    table.in_map += is_in_map;
    table.outside += is_outside;
    if (!row.is_answered()) continue;
    ++table.answered;
    const auto match = keyframes.find(row.match);
    bool is_right = false;
    if (match != keyframes.end()) {
      const Pose error = (match->second.inverse() * *truth).inverse() * row.T_match_lidar;
      const double error_m = error.translation().norm(), error_deg = to_degrees(rotation_angle(error));
      is_right = error_m <= rules.right_translation_m && error_deg <= rules.right_rotation_deg;
      if (is_right) {
        errors_m.push_back(error_m);
        errors_deg.push_back(error_deg);
      }
    }
    table.right += is_right && is_in_map;
    if (is_right) continue;
    ++table.false_answers;
    table.false_outside += is_outside;
    table.false_frames.push_back(row.frame);
  }
  table.median_error_m = percentile(errors_m, 0.5);
  table.p95_error_m = percentile(errors_m, 0.95);
  table.median_error_deg = percentile(errors_deg, 0.5);
  table.median_ms = percentile(ms, 0.5);
  table.p99_ms = percentile(ms, 0.99);
  return table;
}

}  // namespace revisit
