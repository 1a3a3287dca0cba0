// SPDX-License-Identifier: Apache-2.0
#include <revisit/verification/loop_probability.hpp>

#include <algorithm>
#include <cmath>

namespace revisit {
namespace {

struct Coefficients {
  double inlier_share, free_space, intensity, rmse, overlap, least_fixed, few, constant;
};

// Learnt by scripts/learn_probability.py.
constexpr Coefficients kWithIntensity{16.76, 2.089, 7.746, -11.44, -16.78, 7.027, 4.942, -12.58};
constexpr Coefficients kWithoutIntensity{16.71, 1.89, 0.0, -10.66, -14.75, 8.38, 3.99, -8.246};
// Beyond these, nothing was learnt.
constexpr double kFarthest_m = 12.0, kMostShare = 1.1, kFewestInliers = 10.0;
constexpr double kEnoughInliers = 300.0;  // fewer may fit by chance
constexpr double kUnseenAMetre = 0.03;    // share of what fits that is out of sight, for each metre between the sensors

}  // namespace

double loop_log_odds(const LoopEvidence& evidence) {
  const Coefficients& c = evidence.intensity_agreement ? kWithIntensity : kWithoutIntensity;
  // Disagreement counts by its order of magnitude: one point in a hundred seen through, or three.
  const double free_space = -std::log(1.004 - std::clamp(evidence.free_space_agreement, 0.0, 1.0));
  const double in_sight = 1.0 - kUnseenAMetre * std::min(evidence.distance_m, kFarthest_m);
  return c.constant + c.inlier_share * std::min(evidence.inlier_share / in_sight, kMostShare) +
         c.free_space * free_space + c.intensity * std::clamp(evidence.intensity_agreement.value_or(0.0), -0.2, 1.1) +
         c.rmse * evidence.rmse_m / evidence.voxel_m + c.overlap * evidence.overlap +
         c.least_fixed * std::sqrt(std::max(0.0, evidence.least_fixed)) +
         c.few * std::log(std::clamp(static_cast<double>(evidence.inliers), kFewestInliers, kEnoughInliers) /
                          kEnoughInliers);
}

double probability_of(double log_odds) { return 1.0 / (1.0 + std::exp(-log_odds)); }

}  // namespace revisit
