// SPDX-License-Identifier: Apache-2.0
#include <revisit/verification/acceptance.hpp>

namespace revisit {
namespace {

// What normals that are off by two degrees and a half show of a direction that nothing faces. Of a Livox along real
// walls, right loops have .005 and more.
constexpr double kLeastFixed = 0.002;
constexpr double kMostTranslation_m = 15.0;  // beyond, scans share too little to be right

std::optional<Refusal> refusal_of(const GeometricEvidence& found, const GeometricOptions& options) {
  using Reason = Refusal::Reason;
  const LoopEvidence& evidence = found.evidence;
  if (evidence.inlier_ratio < options.min_inlier_ratio)
    return Refusal{Reason::kFewInliers, evidence.inlier_ratio, options.min_inlier_ratio};
  if (evidence.least_fixed < kLeastFixed) return Refusal{Reason::kSlides, evidence.least_fixed, kLeastFixed};
  if (found.probability < options.min_probability)
    return Refusal{Reason::kImprobable, found.probability, options.min_probability};
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
