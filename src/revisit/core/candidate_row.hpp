// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include <revisit/core/ids.hpp>

namespace revisit {

/// One row of candidates.csv: what was answered to a query that had a searchable past.
struct CandidateRow {
  FrameId query;
  std::optional<FrameId> match;  ///< absent where nothing was found
  double score = 0.0;            ///< orders answers by confidence, larger is surer
  bool accepted = false;
  std::string reason;  ///< why not accepted, in words; empty where accepted
};

}  // namespace revisit
