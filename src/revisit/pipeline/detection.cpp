// SPDX-License-Identifier: Apache-2.0
#include <revisit/pipeline/detection.hpp>

#include <algorithm>

#include <revisit/core/refusal_text.hpp>
#include <revisit/core/text.hpp>

namespace revisit {

const Detection::Registered* Detection::likeliest() const {
  const auto best = std::max_element(
      registered.begin(), registered.end(),
      [](const Registered& a, const Registered& b) { return a.evidence.own_log_odds < b.evidence.own_log_odds; });
  return best == registered.end() ? nullptr : &*best;
}

std::string Detection::reason() const {
  if (!refusal) return {};
  std::string text = to_text(*refusal);
  if (refusal->reason == Refusal::Reason::kImprobable && geometric) {
    const LoopEvidence& e = geometric->evidence;
    text += format(" (inliers %.2f; free space %.2f; intensity %.2f; rmse %.2f m)", e.inlier_ratio,
                   e.free_space_agreement, e.intensity_agreement.value_or(0.0), e.rmse_m);
  }
  return text;
}

std::vector<LoopConstraint> Detection::loops() const {
  std::vector<LoopConstraint> loops;
  if (loop) loops.push_back(*loop);
  for (const Detection& each : earlier)
    if (each.loop) loops.push_back(*each.loop);
  return loops;
}

CandidateRow Detection::row() const {
  CandidateRow row;
  row.query = frame;
  if (answer) row.match = answer->match;
  row.score = score;
  row.accepted = loop.has_value();
  row.reason = reason();
  return row;
}

}  // namespace revisit
