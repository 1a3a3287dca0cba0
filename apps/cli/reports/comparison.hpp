// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <revisit/core/result.hpp>
#include <revisit/descriptors/baseline.hpp>
#include <revisit/evaluation/given_pose_table.hpp>

#include "reports/report.hpp"

namespace revisit::cli {

/// One method's tables 1 and 2, and what it is.
struct MethodReport {
  std::string name, source;
  bool is_verified = false;  ///< otherwise there is no table 2
  Baseline::Gives gives = Baseline::Gives::kPlace;
  std::size_t scans = 1;         ///< described together; more than one are laid together by odometry
  double retrieval_ms = 0.0;     ///< describing and searching, a scan, on one thread
  double verification_ms = 0.0;  ///< likewise
  std::size_t bytes_a_place = 0;
  EvaluationReport evaluation;
  RetrievalTable pairs;  ///< by the protocol of pair lists; none: not asked for
  GivenPoseTable poses;  ///< what its right answers say of the pose
};

/// All methods in one table each, a row a method.
std::string to_text(const std::vector<MethodReport>& methods);
std::string to_json(const std::vector<MethodReport>& methods);
/// A row a method, all columns of both tables.
std::string to_csv(const std::vector<MethodReport>& methods);
/// Both tables for a paper (package booktabs).
std::string to_latex(const std::vector<MethodReport>& methods);
/// The protocol of pair lists, which shares no table with the others.
std::string pairs_to_text(const std::vector<MethodReport>& methods);
std::string pairs_to_csv(const std::vector<MethodReport>& methods);
/// Precision over recall of all of them.
Status draw_comparison(const std::filesystem::path& file, const std::vector<MethodReport>& methods);

}  // namespace revisit::cli
