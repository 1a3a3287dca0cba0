// SPDX-License-Identifier: Apache-2.0
#include "reports/comparison.hpp"

#include <array>

#include <nlohmann/json.hpp>

#include <revisit/core/text.hpp>

#include "pictures/evaluation_pictures.hpp"
#include "reports/table.hpp"

namespace revisit::cli {

std::string to_text(const std::vector<MethodReport>& methods) {
  Table retrieval = {
      {"", "revisits", "R@1", "F1max", "AP", "R@P100", "EP", "reverse R@1", "reverse R@P100", "ms a scan"}};
  Table loops = {{"", "accepted", "false loops", "recall", "reverse recall", "translation median", "rotation median"}};
  for (const MethodReport& method : methods) {
    const RetrievalTable &all = method.evaluation.retrieval, &reverse = method.evaluation.reverse_retrieval;
    const auto figure = [](double value, std::size_t of) { return of == 0 ? std::string("-") : format("%.3f", value); };
    retrieval.push_back({method.name, std::to_string(all.revisits), figure(all.recall_at_1, all.revisits),
                         figure(all.f1_max, all.revisits), figure(all.average_precision, all.revisits),
                         figure(all.recall_at_p100, all.revisits), figure(all.extended_precision, all.revisits),
                         figure(reverse.recall_at_1, reverse.revisits),
                         figure(reverse.recall_at_p100, reverse.revisits), format("%.1f", method.ms_per_scan)});
    if (!method.gives_poses) continue;
    const LoopTable& t = method.evaluation.loops;
    loops.push_back({method.name, std::to_string(t.accepted), std::to_string(t.false_loops),
                     figure(t.recall, t.revisits), figure(t.reverse_recall, t.reverse_revisits),
                     t.accepted == 0 ? "-" : format("%.3f m", t.median_translation_m),
                     t.accepted == 0 ? "-" : format("%.3f deg", t.median_rotation_deg)});
  }
  std::string text = "Table 1, retrieval (top-1, score swept)\n" + to_text(retrieval) +
                     "\nTable 2, loop constraints (as accepted), of the methods that give a pose\n" + to_text(loops) +
                     "\n";
  for (const MethodReport& method : methods) text += method.name + ": " + method.source + "\n";
  return text;
}

std::string to_json(const std::vector<MethodReport>& methods) {
  nlohmann::ordered_json document = nlohmann::ordered_json::object();
  for (const MethodReport& method : methods) {
    auto entry = nlohmann::ordered_json::parse(to_json(method.evaluation));
    if (!method.gives_poses) entry.erase("table_2");
    entry["source"] = method.source;
    entry["ms_per_scan"] = method.ms_per_scan;
    document[method.name] = std::move(entry);
  }
  return document.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

Status draw_comparison(const std::filesystem::path& file, const std::vector<MethodReport>& methods) {
  constexpr std::array kColours{Colour{0.85, 0.05, 0.05}, Colour{0.12, 0.35, 0.70}, Colour{0.50, 0.70, 0.90},
                                Colour{0.95, 0.60, 0.10}, Colour{0.55, 0.30, 0.05}, Colour{0.20, 0.60, 0.25},
                                Colour{0.45, 0.45, 0.45}};
  std::vector<Curve> curves;
  for (std::size_t i = 0; i < methods.size(); ++i)
    curves.push_back({methods[i].name, &methods[i].evaluation.retrieval, kColours[i % kColours.size()]});
  return draw_precision_recall(file, curves);
}

}  // namespace revisit::cli
