// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <revisit/config/parameters.hpp>
#include <revisit/verification/geometric.hpp>

namespace revisit {

/// What accepts a loop, and what refuses it: inliers, then the probability of all evidence together with the prior, how
/// well the position is fixed, and distance. `of_recording_log_odds` corrects the pair's own evidence for this
/// recording (LookAlikes); the prior is what is known besides: loops before (LoopFollowing), odometry (elsewhere.hpp),
/// poses that exclude this one. Log odds, 0 where there is none.
void decide(GeometricEvidence& found, double of_recording_log_odds, double prior_log_odds,
            const GeometricOptions& options);

}  // namespace revisit
