// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include <revisit/evaluation/loop_table.hpp>
#include <revisit/evaluation/retrieval_table.hpp>
#include <revisit/evaluation/session_table.hpp>
#include <revisit/evaluation/trajectory_table.hpp>
#include <revisit/evaluation/waking_table.hpp>

namespace revisit::cli {

/// What `evaluate` found: tables 1 to 3 of docs/evaluation.md.
struct EvaluationReport {
  std::string results, reference;
  EvaluationRules rules;
  RetrievalTable retrieval, reverse_retrieval;
  LoopTable loops;
  struct Trajectories {
    TrajectoryTable odometry, corrected;
  };
  std::optional<Trajectories> trajectories;  ///< of `revisit slam`
};

std::string to_text(const EvaluationReport& report);
std::string to_json(const EvaluationReport& report);
/// Precision over recall, a row a score.
std::string curve_csv(const RetrievalTable& table);
/// Table 5; `keyframes` are those of the map.
std::string to_text(const WakingTable& table, std::size_t keyframes);
std::string to_json(const WakingTable& table, std::size_t keyframes);
/// Table 6.
std::string to_text(const SessionTable& table);
/// A page that shows the tables and the pictures beside it.
std::string to_html(const EvaluationReport& report);

}  // namespace revisit::cli
