// SPDX-License-Identifier: Apache-2.0
#include <revisit/evaluation/loop_table.hpp>

#include <algorithm>
#include <cmath>
#include <set>

#include <revisit/evaluation/internal/percentile.hpp>

namespace revisit {
namespace {

using evaluation_internal::percentile;

double share(std::size_t part, std::size_t whole) {
  return whole == 0 ? 0.0 : static_cast<double>(part) / static_cast<double>(whole);
}

}  // namespace

LoopTable evaluate_loops(const std::vector<LoopConstraint>& loops, const Reference& reference) {
  LoopTable table;
  table.revisits = reference.revisits().size();
  table.reverse_revisits = reference.reverse_revisits();
  std::vector<double> translations, rotations;
  std::set<FrameId> found, found_reverse;
  for (const LoopConstraint& loop : loops) {
    const auto T_truth = reference.T_match_query(loop.match, loop.query);
    if (!T_truth) {
      ++table.without_reference;
      continue;
    }
    const Pose T_error = T_truth->inverse() * loop.T_match_query;
    JudgedLoop judged{loop.query, loop.match, T_error.translation().norm(), to_degrees(rotation_angle(T_error)), false};
    judged.right = judged.translation_error_m <= reference.rules().right_translation_m &&
                   judged.rotation_error_deg <= reference.rules().right_rotation_deg;
    ++table.accepted;
    table.false_loops += !judged.right;
    translations.push_back(judged.translation_error_m);
    rotations.push_back(judged.rotation_error_deg);
    const auto revisit = reference.revisits().find(loop.query);
    if (judged.right && revisit != reference.revisits().end()) {
      found.insert(loop.query);
      if (revisit->second.reverse) found_reverse.insert(loop.query);
    }
    table.loops.push_back(judged);
  }
  if (table.accepted > 0) table.precision = share(table.accepted - table.false_loops, table.accepted);
  table.recall = share(found.size(), table.revisits);
  table.reverse_recall = share(found_reverse.size(), table.reverse_revisits);
  table.median_translation_m = percentile(translations, 0.5);
  table.p95_translation_m = percentile(translations, 0.95);
  table.median_rotation_deg = percentile(rotations, 0.5);
  table.p95_rotation_deg = percentile(rotations, 0.95);
  return table;
}

}  // namespace revisit
