// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include <revisit/evaluation/retrieval_table.hpp>

namespace revisit::evaluation_internal {

struct Answer {
  double score;
  bool right;
};

/// The table of answers as their score is swept, `revisits` of which could be right.
RetrievalTable sweep(std::vector<Answer> answers, std::size_t revisits);

}  // namespace revisit::evaluation_internal
