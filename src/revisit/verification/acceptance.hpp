// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <revisit/config/parameters.hpp>
#include <revisit/verification/geometric.hpp>

namespace revisit {

/// What accepts a loop, and what refuses it: inliers, then the probability of all evidence together with the prior,
/// convergence and distance. The prior, in log odds, is the support of the loops before (LoopFollowing); 0 without.
void decide(GeometricEvidence& found, double prior_log_odds, const GeometricOptions& options);

}  // namespace revisit
