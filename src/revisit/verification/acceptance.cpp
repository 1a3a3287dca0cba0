// SPDX-License-Identifier: Apache-2.0
#include <revisit/verification/acceptance.hpp>

namespace revisit {
namespace {

// Beyond, one pose in ten is more than 0.5 m off: points share the errors of their surfaces (docs/accuracy.md, "How
// well a position is fixed").
constexpr double kMostStddev_m = 0.1;
constexpr double kMostTranslation_m = 15.0;  // beyond, scans share too little to be right

std::optional<Refusal> refusal_of(const GeometricEvidence& found, const GeometricOptions& options) {
  using Reason = Refusal::Reason;
  const LoopEvidence& evidence = found.evidence;
  if (evidence.inlier_ratio < options.min_inlier_ratio)
    return Refusal{Reason::kFewInliers, evidence.inlier_ratio, options.min_inlier_ratio};
  if (found.probability < options.min_probability)
    return Refusal{Reason::kImprobable, found.probability, options.min_probability};
  if (evidence.stddev_m > kMostStddev_m) return Refusal{Reason::kSlides, evidence.stddev_m, kMostStddev_m};
  if (evidence.distance_m > kMostTranslation_m)
    return Refusal{Reason::kTooFar, evidence.distance_m, kMostTranslation_m};
  return std::nullopt;
}

}  // namespace

void decide(GeometricEvidence& found, double of_recording_log_odds, double prior_log_odds,
            const GeometricOptions& options) {
  found.own_log_odds = loop_log_odds(found.evidence) + of_recording_log_odds;
  found.log_odds = found.own_log_odds + prior_log_odds;
  found.probability = probability_of(found.log_odds);
  found.refusal = refusal_of(found, options);
}

}  // namespace revisit
