// SPDX-License-Identifier: Apache-2.0
#include <revisit/verification/loop_probability.hpp>

#include <algorithm>
#include <cmath>

namespace revisit {
namespace {

struct Coefficients {
  double inlier_share, free_space, intensity, rmse_m, overlap, distance, distance_root, constant;
};

// Learnt by scripts/learn_probability.py.
constexpr Coefficients kWithIntensity{21.483, 0.810, 17.762, -65.184, 5.738, 6.232, 8.613, -32.360};
constexpr Coefficients kWithoutIntensity{30.213, 0.158, 0.0, 0.0, 0.0, 15.161, -0.468, -26.153};
constexpr double kFarthest_m = 12.0;  // beyond, nothing was learnt
// The less of the horizon a sensor sees, the more places look alike to it: a street looks much the same from both ends.
// Chosen on two drives with a forward sensor (docs/accuracy.md).
constexpr double kUnseenHorizon = -6.0;

}  // namespace

double loop_log_odds(const LoopEvidence& evidence) {
  const Coefficients& c = evidence.intensity_agreement ? kWithIntensity : kWithoutIntensity;
  // Disagreement counts by its order of magnitude: one point in a hundred seen through, or three.
  const double free_space = -std::log(1.004 - std::clamp(evidence.free_space_agreement, 0.0, 1.0));
  const double distance = std::min(evidence.distance_m, kFarthest_m) / 10.0;  // in tens of metres
  return c.constant + c.inlier_share * evidence.inlier_share + c.free_space * free_space +
         c.intensity * evidence.intensity_agreement.value_or(0.0) + c.rmse_m * evidence.rmse_m +
         c.overlap * evidence.overlap + c.distance * distance + c.distance_root * std::sqrt(distance) +
         kUnseenHorizon * (1.0 - evidence.horizon);
}

double probability_of(double log_odds) { return 1.0 / (1.0 + std::exp(-log_odds)); }

}  // namespace revisit
