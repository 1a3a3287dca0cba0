// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <vector>

#include <revisit/core/candidate_row.hpp>
#include <revisit/core/result.hpp>
#include <revisit/evaluation/reference.hpp>

#include "reports/report.hpp"

namespace revisit::cli {

/// A page of one method of `revisit compare` in its folder: report.html with its tables, precision_recall.png,
/// trajectory.png (its loops or, where nothing was verified, its answers at the score of F1max), and failures.csv: what
/// was false or missed at that score.
Status write_method_page(const std::filesystem::path& folder, const EvaluationReport& report,
                         const std::vector<CandidateRow>& candidates, const Reference& reference, bool is_verified);

}  // namespace revisit::cli
