// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <vector>

#include <revisit/evaluation/retrieval_table.hpp>

namespace revisit {

/// Two frames, the query the later one, that are of one place or of two.
struct FramePair {
  FrameId match;
  bool is_same_place = false;
};
/// By query.
using PairLists = std::map<FrameId, std::vector<FramePair>>;

/// The pairs of the SSC lineage (Li et al., IROS 2021): all that are less than 3 m apart and more than 50 frames, and
/// of those that are more than 20 m apart 100 for each of them, drawn by `seed`. What lies between is left out.
PairLists make_pair_lists(const Trajectory& trajectory, std::uint64_t seed = 1);

struct ScoredPair {
  double score = 0.0;
  bool is_same_place = false;
};
/// F1max and EP of telling the ones from the others as the score is swept; `revisits` counts the pairs of one place.
RetrievalTable evaluate_pairs(const std::vector<ScoredPair>& pairs);

}  // namespace revisit
