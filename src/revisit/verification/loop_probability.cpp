// SPDX-License-Identifier: Apache-2.0
#include <revisit/verification/loop_probability.hpp>

#include <algorithm>
#include <cmath>

namespace revisit {
namespace {

struct Coefficients {
  double inlier_share, free_space, intensity, rmse, residual, least_fixed, few, hidden, constant;
};

// Learnt by scripts/learn_probability.py, in the open and in rooms. There, places resemble one another more, and the
// same measures say less.
struct Model {
  Coefficients with_intensity, without;
};
// In the open, `few` is what an earlier set of rooms gave: hardly any such pair is there to learn from.
// `hidden` is not learnt there: what came and went since the earlier visit hides as much as another place does. Nor is
// `residual`: of trees it is their leaves, of walls the sensor's noise, which differs from sensor to sensor.
constexpr Model kInTheOpen{{16.69, 3.579, 13.02, -75.88, 0.0, 13.41, 3.394, 0.0, -24.31},
                           {11.14, 2.589, 0.0, -41.78, 0.0, 9.628, 2.708, 0.0, -11.81}};
constexpr Model kInRooms{{18.81, 2.426, 8.543, 0.0, -8.35, 6.312, 1.712, -8.961, -22.24},
                         {17.07, 2.581, 0.0, 0.0, -7.966, 6.251, 3.852, -8.633, -15.07}};
// Beyond these, nothing was learnt.
constexpr double kFarthest_m = 12.0, kMostShare = 1.1, kFewestInliers = 10.0;
constexpr double kEnoughInliers = 300.0;  // fewer may fit by chance
// A sector of a street fits in more places than all that is around, and such pairs were not learnt on. One of them
// narrow, towns of seed 97: wrong ones reach 6 where wrong views all round reach 1. Both: 4 of 1,447 scans of another
// town were answered without (seed 171).
constexpr double kOneNarrow_log_odds = -5.0, kBothNarrow_log_odds = -3.0;
// For each metre between the sensors: what fits less, the share of all points that is hidden at the right place, and
// by how much the residual is larger.
constexpr double kLessAMetre = 0.02, kHiddenAMetre = 0.03, kResidualAMetre = 0.03;

double of_narrow_views(const LoopEvidence& evidence) {
  if (evidence.one_is_narrow) return kOneNarrow_log_odds;
  return evidence.both_are_narrow && evidence.in_the_open ? kBothNarrow_log_odds : 0.0;
}

double log_odds_by(const Coefficients& c, const LoopEvidence& evidence) {
  // Disagreement counts by its order of magnitude: one point in a hundred seen through, or three.
  const double free_space = -std::log(1.004 - std::clamp(evidence.free_space_agreement, 0.0, 1.0));
  const double distance_m = std::min(evidence.distance_m, kFarthest_m);
  return c.constant + of_narrow_views(evidence) +
         c.inlier_share * std::min(evidence.inlier_share / (1.0 - kLessAMetre * distance_m), kMostShare) +
         c.free_space * free_space + c.hidden * (evidence.hidden_share - kHiddenAMetre * distance_m) +
         c.intensity * std::clamp(evidence.intensity_agreement.value_or(0.0), -0.2, 1.1) +
         c.rmse * evidence.rmse_m / evidence.voxel_m +
         c.residual * std::max(1.0, evidence.residual_share / (1.0 + kResidualAMetre * distance_m)) +
         c.least_fixed * std::sqrt(std::max(0.0, evidence.least_fixed)) +
         c.few * std::log(std::clamp(static_cast<double>(evidence.inliers), kFewestInliers, kEnoughInliers) /
                          kEnoughInliers);
}

double log_odds_by(const Model& model, const LoopEvidence& evidence) {
  if (!evidence.intensity_agreement) return log_odds_by(model.without, evidence);
  const double with = log_odds_by(model.with_intensity, evidence);
  if (!evidence.sensors_differ) return with;
  // Intensities of two sensors are comparable or not, as likely one as the other: the mean of both odds.
  const double without = log_odds_by(model.without, evidence), more = std::max(with, without);
  return more + std::log(0.5 * (std::exp(with - more) + std::exp(without - more)));
}

}  // namespace

// A scan of a room and one of the open see little of each other: the more cautious of both judgements counts.
double loop_log_odds(const LoopEvidence& evidence) {
  const double log_odds = log_odds_by(evidence.in_the_open ? kInTheOpen : kInRooms, evidence);
  return evidence.one_in_a_room ? std::min(log_odds, log_odds_by(kInRooms, evidence)) : log_odds;
}

double probability_of(double log_odds) { return 1.0 / (1.0 + std::exp(-log_odds)); }

}  // namespace revisit
