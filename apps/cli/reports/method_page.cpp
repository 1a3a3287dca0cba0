// SPDX-License-Identifier: Apache-2.0
#include "reports/method_page.hpp"

#include <array>
#include <limits>
#include <optional>
#include <set>
#include <string>

#include <revisit/core/text.hpp>
#include <revisit/io/result_files.hpp>

#include "pictures/evaluation_pictures.hpp"

namespace revisit::cli {
namespace {

double f1_of(const PrecisionRecall& point) {
  const double sum = point.precision + point.recall;
  return sum > 0.0 ? 2.0 * point.precision * point.recall / sum : 0.0;
}

// The least score of the answers that give F1max; nothing where none is right.
std::optional<double> score_of_f1_max(const RetrievalTable& table) {
  const PrecisionRecall* best = nullptr;
  for (const PrecisionRecall& point : table.curve)
    if (f1_of(point) > (best == nullptr ? 0.0 : f1_of(*best))) best = &point;
  return best == nullptr ? std::nullopt : std::optional(best->score);
}

// Answers as loops that are judged by the place alone.
LoopTable answers_from(double least_score, const std::vector<CandidateRow>& candidates, const Reference& reference) {
  LoopTable table;
  table.revisits = reference.revisits().size();
  for (const CandidateRow& row : candidates) {
    if (!row.match || row.score < least_score) continue;
    const auto distance_m = reference.distance_m(*row.match, row.query);
    if (!distance_m) continue;
    const bool right = reference.revisits().contains(row.query) && *distance_m <= reference.rules().same_place_m;
    table.loops.push_back({row.query, *row.match, *distance_m, 0.0, right});
    ++table.accepted;
    table.false_loops += !right;
  }
  return table;
}

// False answers, and then revisits that have none that is right.
std::string failures_csv(const LoopTable& answers, const Reference& reference) {
  std::string text = "query,what,match,distance_m,nearest,nearest_m\n";
  std::set<FrameId> found;
  const auto nearest = [&](FrameId query) {
    const auto revisit = reference.revisits().find(query);
    return revisit == reference.revisits().end()
               ? std::string(",")
               : std::to_string(revisit->second.nearest.value) + format(",%.2f", revisit->second.distance_m);
  };
  for (const JudgedLoop& answer : answers.loops) {
    found.insert(answer.query);
    if (!answer.right)
      text += std::to_string(answer.query.value) + ",false," + std::to_string(answer.match.value) +
              format(",%.2f,", answer.translation_error_m) + nearest(answer.query) + "\n";
  }
  for (const auto& [query, revisit] : reference.revisits())
    if (!found.contains(query)) text += std::to_string(query.value) + ",missed,,," + nearest(query) + "\n";
  return text;
}

}  // namespace

Status write_method_page(const std::filesystem::path& folder, const EvaluationReport& report,
                         const std::vector<CandidateRow>& candidates, const Reference& reference, bool is_verified) {
  const auto score = score_of_f1_max(report.retrieval);
  const LoopTable answers =
      answers_from(score.value_or(std::numeric_limits<double>::infinity()), candidates, reference);
  const std::array written{
      draw_precision_recall(folder / "precision_recall.png", report.retrieval, report.reverse_retrieval),
      is_verified ? draw_trajectory(folder / "trajectory.png", reference, report.loops)
                  : draw_trajectory(folder / "trajectory.png", reference, answers, "answers at the score of F1max"),
      write_text(folder / "precision_recall.csv", curve_csv(report.retrieval)),
      write_text(folder / "failures.csv", failures_csv(answers, reference)),
      write_text(folder / "report.html", to_html(report))};
  for (const Status& status : written)
    if (!status) return status;
  return ok();
}

}  // namespace revisit::cli
