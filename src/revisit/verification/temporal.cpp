// SPDX-License-Identifier: Apache-2.0
#include <revisit/verification/temporal.hpp>

#include <revisit/descriptors/similarity.hpp>

namespace revisit {
namespace {

struct Mean {
  double sum = 0.0;
  int pairs = 0;
  double value() const { return pairs == 0 ? 0.0 : sum / pairs; }
};

Mean mean_score(FrameId query, FrameId match, int direction, const DescriptorLookup& query_descriptor,
                const DescriptorLookup& match_descriptor) {
  Mean mean;
  for (int k = 1; k <= kTemporalPairs; ++k) {
    const auto q = query_descriptor(FrameId{query.value - k});
    const auto m = match_descriptor(FrameId{match.value - std::int64_t{direction} * k});
    if (!q || !m) continue;
    mean.sum += match_descriptors(*q, *m).score();
    ++mean.pairs;
  }
  return mean;
}

}  // namespace

TemporalEvidence check_temporal(FrameId query, FrameId match, const DescriptorLookup& query_descriptor,
                                const DescriptorLookup& match_descriptor, const TemporalOptions& options) {
  const Mean forward = mean_score(query, match, 1, query_descriptor, match_descriptor);
  const Mean reverse = mean_score(query, match, -1, query_descriptor, match_descriptor);
  TemporalEvidence evidence;
  evidence.forward_pairs = forward.pairs;
  evidence.reverse_pairs = reverse.pairs;
  evidence.forward_score = forward.value();
  evidence.reverse_score = reverse.value();
  evidence.reverse = evidence.reverse_score > evidence.forward_score;
  evidence.score = evidence.reverse ? evidence.reverse_score : evidence.forward_score;
  if (forward.pairs + reverse.pairs > 0 && evidence.score < options.min_score)
    evidence.refusal = Refusal{Refusal::Reason::kTemporallyInconsistent, evidence.score, options.min_score};
  return evidence;
}

}  // namespace revisit
