// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include <revisit/core/candidate_row.hpp>
#include <revisit/evaluation/reference.hpp>

namespace revisit {

/// One point of the precision-recall curve: all answers of at least this score.
struct PrecisionRecall {
  double score = 0.0, precision = 0.0, recall = 0.0;
};

/// Table 1: top-1 retrieval as `score` is swept.
struct RetrievalTable {
  std::size_t revisits = 0, answers = 0, right = 0;
  double recall_at_1 = 0.0;  ///< top-1 right, no threshold
  double f1_max = 0.0;
  double average_precision = 0.0;      ///< area under the curve by steps
  double recall_at_p100 = 0.0;         ///< largest recall before the first false answer
  double extended_precision = 0.0;     ///< (precision at the smallest recall + recall_at_p100) / 2
  std::vector<PrecisionRecall> curve;  ///< by falling score; equal scores are one point
};

enum class RevisitKind {
  kAll,
  kReverse,  ///< same-direction revisits are left out; false answers to queries that are no revisits stay
};

/// Answers of frames without a reference pose are left out: nothing can be said about them.
RetrievalTable evaluate_retrieval(const std::vector<CandidateRow>& rows, const Reference& reference,
                                  RevisitKind kind = RevisitKind::kAll);

}  // namespace revisit
