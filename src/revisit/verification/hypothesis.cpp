// SPDX-License-Identifier: Apache-2.0
#include <revisit/verification/hypothesis.hpp>

#include <algorithm>
#include <cmath>

namespace revisit {
namespace {

struct Score {
  static constexpr double kFlattening = 6.0;  ///< of log odds, so that two sure hypotheses still differ
  /// A loop over more than this is a right constraint, but not the same place (docs/evaluation.md). Poses have errors:
  /// close to the limit it is open which of the two it is.
  static constexpr double kSamePlace_m = 4.0, kOpen_m = 0.5;
  static constexpr double kOfRefused = 0.2;  ///< what "the same place" adds to one that was refused; 1 to a loop
};

}  // namespace

double Hypothesis::score() const {
  // Registration decides first, then the view from overhead, then the descriptors.
  const double registered = geometric ? 1.0 / (1.0 + std::exp(-own_log_odds() / Score::kFlattening)) : 0.0;
  const double evidence = candidate.geometry_score / 4.0 + overlap / 4.0 + registered;
  if (!geometric) return evidence;
  const double same_place = std::clamp((Score::kSamePlace_m - distance_m()) / Score::kOpen_m, 0.0, 1.0);
  return is_accepted() ? evidence + 1.0 + same_place : evidence + Score::kOfRefused * same_place;
}

}  // namespace revisit
