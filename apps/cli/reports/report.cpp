// SPDX-License-Identifier: Apache-2.0
#include "reports/report.hpp"

#include <nlohmann/json.hpp>

#include <revisit/core/text.hpp>

#include "reports/table.hpp"

namespace revisit::cli {
namespace {

// Without revisits there is no recall.
Table table_1(const EvaluationReport& report) {
  Table table = {{"", "revisits", "answers", "R@1", "F1max", "AP", "R@P100", "EP"}};
  const auto add = [&](const char* name, const RetrievalTable& t) {
    const auto figure = [&](double value) { return t.revisits == 0 ? std::string("-") : format("%.3f", value); };
    const bool nothing_reverse = &t == &report.reverse_retrieval && t.revisits == 0;
    table.push_back({name, std::to_string(t.revisits), nothing_reverse ? "-" : std::to_string(t.answers),
                     figure(t.recall_at_1), figure(t.f1_max), figure(t.average_precision), figure(t.recall_at_p100),
                     figure(t.extended_precision)});
  };
  add("all", report.retrieval);
  add("reverse", report.reverse_retrieval);
  return table;
}

Table table_2(const EvaluationReport& report) {
  const LoopTable& t = report.loops;
  const auto recall = [](double value, std::size_t of) { return of == 0 ? std::string("-") : format("%.3f", value); };
  const auto error = [&](double value, const char* unit) {
    return t.accepted == 0 ? std::string("-") : format("%.3f %s", value, unit);
  };
  return {
      {"accepted", "false loops", "precision", "recall", "reverse recall", "translation median", "95 %",
       "rotation median", "95 %"},
      {std::to_string(t.accepted), std::to_string(t.false_loops), t.accepted == 0 ? "-" : format("%.3f", t.precision),
       recall(t.recall, t.revisits), recall(t.reverse_recall, t.reverse_revisits), error(t.median_translation_m, "m"),
       error(t.p95_translation_m, "m"), error(t.median_rotation_deg, "deg"), error(t.p95_rotation_deg, "deg")}};
}

Table table_3(const EvaluationReport::Trajectories& trajectories) {
  Table table = {{"", "frames", "length", "ATE", "at most", "relative", "relative"}};
  const auto add = [&](const char* name, const TrajectoryTable& t) {
    table.push_back({name, std::to_string(t.frames), format("%.0f m", t.length_m), format("%.3f m", t.ate_m),
                     format("%.3f m", t.worst_m), t.relative_percent ? format("%.3f %%", *t.relative_percent) : "-",
                     t.relative_deg_per_m ? format("%.5f deg/m", *t.relative_deg_per_m) : "-"});
  };
  add("odometry", trajectories.odometry);
  add("loops closed", trajectories.corrected);
  return table;
}

std::string rules_text(const EvaluationReport& report) {
  const EvaluationRules& rules = report.rules;
  std::string text = format(
      "Frames at least %d frames and %.1f s older may be matched; the same place is within %.1f m; a loop is right "
      "within %.1f m and %.1f degrees.",
      rules.exclude_frames, rules.exclude_s, rules.same_place_m, rules.right_translation_m, rules.right_rotation_deg);
  text += " An answer farther away is false in table 1, though its pose may be right in table 2.";
  if (report.loops.without_reference > 0)
    text += format(" %zu accepted loops have no reference pose and are not judged.", report.loops.without_reference);
  return text;
}

}  // namespace

std::string to_text(const EvaluationReport& report) {
  return "Table 1, retrieval (top-1, score swept)\n" + to_text(table_1(report)) +
         "\nTable 2, loop constraints (as accepted)\n" + to_text(table_2(report)) +
         (report.trajectories ? "\nTable 3, trajectory\n" + to_text(table_3(*report.trajectories)) : "") + "\n" +
         rules_text(report) + "\n";
}

std::string to_json(const EvaluationReport& report) {
  const auto retrieval = [](const RetrievalTable& t) {
    return nlohmann::ordered_json{{"revisits", t.revisits},
                                  {"answers", t.answers},
                                  {"right", t.right},
                                  {"recall_at_1", t.recall_at_1},
                                  {"f1_max", t.f1_max},
                                  {"average_precision", t.average_precision},
                                  {"recall_at_p100", t.recall_at_p100},
                                  {"extended_precision", t.extended_precision}};
  };
  const LoopTable& l = report.loops;
  nlohmann::ordered_json document = {
      {"results", report.results},
      {"reference", report.reference},
      {"rules",
       {{"exclude_frames", report.rules.exclude_frames},
        {"exclude_s", report.rules.exclude_s},
        {"same_place_m", report.rules.same_place_m},
        {"right_translation_m", report.rules.right_translation_m},
        {"right_rotation_deg", report.rules.right_rotation_deg}}},
      {"table_1", {{"all", retrieval(report.retrieval)}, {"reverse", retrieval(report.reverse_retrieval)}}},
      {"table_2",
       {{"accepted", l.accepted},
        {"false_loops", l.false_loops},
        {"without_reference", l.without_reference},
        {"precision", l.precision},
        {"recall", l.recall},
        {"reverse_recall", l.reverse_recall},
        {"median_translation_m", l.median_translation_m},
        {"p95_translation_m", l.p95_translation_m},
        {"median_rotation_deg", l.median_rotation_deg},
        {"p95_rotation_deg", l.p95_rotation_deg}}}};
  const auto optional = [](const std::optional<double>& value) {
    return value ? nlohmann::ordered_json(*value) : nlohmann::ordered_json();
  };
  const auto trajectory = [&](const TrajectoryTable& t) {
    return nlohmann::ordered_json{{"frames", t.frames},
                                  {"length_m", t.length_m},
                                  {"ate_m", t.ate_m},
                                  {"worst_m", t.worst_m},
                                  {"relative_percent", optional(t.relative_percent)},
                                  {"relative_deg_per_m", optional(t.relative_deg_per_m)}};
  };
  if (report.trajectories)
    document["table_3"] = {{"odometry", trajectory(report.trajectories->odometry)},
                           {"corrected", trajectory(report.trajectories->corrected)}};
  return document.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

std::string curve_csv(const RetrievalTable& table) {
  std::string text = "score,precision,recall\n";
  for (const PrecisionRecall& point : table.curve)
    text += format("%.9g,%.6f,%.6f\n", point.score, point.precision, point.recall);
  return text;
}

std::string to_html(const EvaluationReport& report) {
  return "<!doctype html>\n<html lang=\"en\"><meta charset=\"utf-8\"><title>revisit: loop closures</title>\n"
         "<style>body{font-family:sans-serif;max-width:1000px;margin:2em auto}table{border-collapse:collapse}"
         "th,td{border:1px solid #bbb;padding:.3em .7em;text-align:right}img{max-width:100%}</style>\n"
         "<h1>Loop closures</h1>\n<p>Results: " +
         html_escape(report.results) + "<br>Reference: " + html_escape(report.reference) + "</p>\n<p>" +
         rules_text(report) + "</p>\n<h2>Table 1, retrieval</h2>\n" + to_html(table_1(report)) +
         "<p>R@1: recall without a threshold. F1max: best harmonic mean of precision and recall. AP: area under the "
         "curve. "
         "R@P100: recall before the first false answer. EP: mean of the first precision and R@P100.</p>\n" +
         "<h2>Table 2, loop constraints</h2>\n" + to_html(table_2(report)) +
         (report.trajectories
              ? "<h2>Table 3, trajectory</h2>\n" + to_html(table_3(*report.trajectories)) +
                    "<p>ATE: root of the mean square of the distance to the reference, after alignment. Relative: "
                    "KITTI's "
                    "error over 100 to 800 m.</p>\n<img src=\"trajectories.png\" alt=\"both trajectories\">\n"
              : "") +
         "<h2>Trajectory and loops</h2>\n<img src=\"trajectory.png\" alt=\"trajectory with loops\">\n"
         "<h2>Precision and recall</h2>\n<img src=\"precision_recall.png\" alt=\"precision over recall\">\n</html>\n";
}

}  // namespace revisit::cli
