// SPDX-License-Identifier: Apache-2.0
#include <revisit/evaluation/retrieval_table.hpp>

#include <algorithm>
#include <utility>

#include <revisit/evaluation/internal/sweep.hpp>

namespace revisit {

RetrievalTable evaluate_retrieval(const std::vector<CandidateRow>& rows, const Reference& reference, RevisitKind kind) {
  std::vector<evaluation_internal::Answer> answers;
  for (const CandidateRow& row : rows) {
    if (!row.match) continue;
    const auto distance_m = reference.distance_m(*row.match, row.query);
    if (!distance_m) continue;
    const auto revisit = reference.revisits().find(row.query);
    const bool is_revisit = revisit != reference.revisits().end();
    if (kind == RevisitKind::kReverse && is_revisit && !revisit->second.reverse) continue;
    answers.push_back({row.score, is_revisit && *distance_m <= reference.rules().same_place_m});
  }
  return evaluation_internal::sweep(
      std::move(answers), kind == RevisitKind::kAll ? reference.revisits().size() : reference.reverse_revisits());
}

RetrievalTable evaluation_internal::sweep(std::vector<Answer> answers, std::size_t count) {
  RetrievalTable table;
  table.revisits = count;
  std::stable_sort(answers.begin(), answers.end(), [](const Answer& a, const Answer& b) { return a.score > b.score; });
  table.answers = answers.size();

  const auto revisits = static_cast<double>(table.revisits);
  double last_recall = 0.0;
  bool pure = true;
  for (std::size_t i = 0; i < answers.size();) {
    const double score = answers[i].score;
    for (; i < answers.size() && answers[i].score == score; ++i) table.right += answers[i].right;
    const double precision = static_cast<double>(table.right) / static_cast<double>(i);
    const double recall = table.revisits == 0 ? 0.0 : static_cast<double>(table.right) / revisits;
    table.curve.push_back({score, precision, recall});
    if (precision + recall > 0.0)
      table.f1_max = std::max(table.f1_max, 2.0 * precision * recall / (precision + recall));
    table.average_precision += (recall - last_recall) * precision;
    last_recall = recall;
    pure = pure && table.right == i;
    if (pure) table.recall_at_p100 = recall;
  }
  table.recall_at_1 = last_recall;
  if (!table.curve.empty()) table.extended_precision = (table.curve.front().precision + table.recall_at_p100) / 2.0;
  return table;
}

}  // namespace revisit
