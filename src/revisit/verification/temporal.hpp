// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <optional>

#include <revisit/config/parameters.hpp>
#include <revisit/core/loop.hpp>
#include <revisit/core/refusal.hpp>
#include <revisit/descriptors/intensity_scan_context.hpp>

namespace revisit {

/// What the neighbours in time say about a candidate (paper, eq. 11).
struct TemporalEvidence {
  int forward_pairs = 0, reverse_pairs = 0;  ///< pairs of which both frames were described
  double forward_score = 0.0;                ///< mean of Phi_g + Phi_i over the pairs (query - k, match - k)
  double reverse_score = 0.0;      ///< the same over (query - k, match + k): the place was passed the other way
  bool reverse = false;            ///< the direction that scored higher
  double score = 0.0;              ///< the higher of both, 0 without pairs
  std::optional<Refusal> refusal;  ///< absent where it is consistent
};

/// N of eq. 11, from table I of the paper.
constexpr int kTemporalPairs = 5;

/// The descriptor of a frame, if there is one.
using DescriptorLookup = std::function<std::optional<DescriptorView>(FrameId)>;

/// Averages the N = kTemporalPairs preceding pairs of frame numbers, in both directions of travel. Frames that a
/// recording leaves out make no pair; without any pair there is nothing to refuse by, and geometry decides alone.
TemporalEvidence check_temporal(FrameId query, FrameId match, const DescriptorLookup& query_descriptor,
                                const DescriptorLookup& match_descriptor, const TemporalOptions& options);

}  // namespace revisit
