// SPDX-License-Identifier: Apache-2.0
#include <revisit/verification/loop_probability.hpp>

#include <algorithm>
#include <cmath>

namespace revisit {
namespace {

struct Coefficients {
  double inlier_share, free_space, intensity, rmse, overlap, distance, distance_root, least_fixed, few, constant;
};

// Learnt by scripts/learn_probability.py.
constexpr Coefficients kWithIntensity{15.6, 1.98, 9.34, -26.5, -11.83, 4.63, 4.61, 8.4, 4.85, -17.28};
constexpr Coefficients kWithoutIntensity{17.9, 1.86, 0.0, -15.28, -13.24, 4.2, 1.66, 9.04, 3.98, -10.7};
// Beyond these, nothing was learnt.
constexpr double kFarthest_m = 12.0, kMostShare = 1.1, kFewestInliers = 10.0;
constexpr double kEnoughInliers = 300.0;  // fewer may fit by chance

}  // namespace

double loop_log_odds(const LoopEvidence& evidence) {
  const Coefficients& c = evidence.intensity_agreement ? kWithIntensity : kWithoutIntensity;
  // Disagreement counts by its order of magnitude: one point in a hundred seen through, or three.
  const double free_space = -std::log(1.004 - std::clamp(evidence.free_space_agreement, 0.0, 1.0));
  const double distance = std::min(evidence.distance_m, kFarthest_m) / 10.0;  // in tens of metres
  return c.constant + c.inlier_share * std::min(evidence.inlier_share, kMostShare) + c.free_space * free_space +
         c.intensity * std::clamp(evidence.intensity_agreement.value_or(0.0), -0.2, 1.1) +
         c.rmse * evidence.rmse_m / evidence.voxel_m + c.overlap * evidence.overlap + c.distance * distance +
         c.distance_root * std::sqrt(distance) + c.least_fixed * std::sqrt(std::max(0.0, evidence.least_fixed)) +
         c.few * std::log(std::clamp(static_cast<double>(evidence.inliers), kFewestInliers, kEnoughInliers) /
                          kEnoughInliers);
}

double probability_of(double log_odds) { return 1.0 / (1.0 + std::exp(-log_odds)); }

}  // namespace revisit
