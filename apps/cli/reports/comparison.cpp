// SPDX-License-Identifier: Apache-2.0
#include "reports/comparison.hpp"

#include <array>

#include <nlohmann/json.hpp>

#include <revisit/core/text.hpp>

#include "pictures/evaluation_pictures.hpp"
#include "reports/table.hpp"

namespace revisit::cli {

namespace {

std::string figure(double value, std::size_t of) { return of == 0 ? std::string("-") : format("%.3f", value); }
std::string cost(double ms) { return ms > 0.0 ? format("%.2f", ms) : std::string("-"); }

Table retrieval_table(const std::vector<MethodReport>& methods) {
  Table table = {{"", "revisits", "R@1", "F1max", "AP", "R@P100", "EP", "reverse R@1", "reverse R@P100", "ms a scan",
                  "kB a place"}};
  for (const MethodReport& method : methods) {
    const RetrievalTable &all = method.evaluation.retrieval, &reverse = method.evaluation.reverse_retrieval;
    table.push_back(
        {method.name, std::to_string(all.revisits), figure(all.recall_at_1, all.revisits),
         figure(all.f1_max, all.revisits), figure(all.average_precision, all.revisits),
         figure(all.recall_at_p100, all.revisits), figure(all.extended_precision, all.revisits),
         figure(reverse.recall_at_1, reverse.revisits), figure(reverse.recall_at_p100, reverse.revisits),
         cost(method.retrieval_ms),
         method.bytes_a_place == 0 ? "-" : format("%.1f", static_cast<double>(method.bytes_a_place) / 1e3)});
  }
  return table;
}

Table loop_table(const std::vector<MethodReport>& methods) {
  Table table = {{"", "accepted", "false loops", "recall", "reverse recall", "translation median", "rotation median",
                  "ms a scan"}};
  for (const MethodReport& method : methods) {
    if (!method.is_verified) continue;
    const LoopTable& t = method.evaluation.loops;
    table.push_back({method.name, std::to_string(t.accepted), std::to_string(t.false_loops),
                     figure(t.recall, t.revisits), figure(t.reverse_recall, t.reverse_revisits),
                     t.accepted == 0 ? "-" : format("%.3f m", t.median_translation_m),
                     t.accepted == 0 ? "-" : format("%.3f deg", t.median_rotation_deg), cost(method.verification_ms)});
  }
  return table;
}

std::string gives(const MethodReport& method) {
  switch (method.gives) {
    case Baseline::Gives::kPlace:
      return "place";
    case Baseline::Gives::kYaw:
      return "yaw";
    case Baseline::Gives::kPlanarPose:
      return "3-DoF";
    case Baseline::Gives::kPose:
      return "6-DoF";
  }
  return {};
}

double right_poses(const GivenPoseTable& t) {
  return t.revisits == 0 ? 0.0 : static_cast<double>(t.right) / static_cast<double>(t.revisits);
}

// What a method does not give stays empty.
Table pose_table(const std::vector<MethodReport>& methods) {
  using enum Baseline::Gives;
  Table table = {{"", "gives", "scans", "right poses", "right places", "yaw median", "yaw 95 %", "plane median",
                  "plane 95 %", "height median", "height 95 %"}};
  for (const MethodReport& method : methods) {
    const GivenPoseTable& t = method.poses;
    const auto given = [&](Baseline::Gives from, const char* form, double value) {
      return t.answers == 0 || method.gives < from ? std::string("-") : format(form, value);
    };
    table.push_back({method.name, gives(method), std::to_string(method.scans),
                     method.gives < kPlanarPose ? "-" : figure(right_poses(t), t.revisits), std::to_string(t.answers),
                     given(kYaw, "%.2f deg", t.median_yaw_deg), given(kYaw, "%.2f deg", t.p95_yaw_deg),
                     given(kPlanarPose, "%.2f m", t.median_plane_m), given(kPlanarPose, "%.2f m", t.p95_plane_m),
                     given(kPose, "%.2f m", t.median_height_m), given(kPose, "%.2f m", t.p95_height_m)});
  }
  return table;
}

}  // namespace

std::string to_text(const std::vector<MethodReport>& methods) {
  std::string text =
      "Table 1, retrieval (top-1, score swept; time and memory of describing and searching)\n" +
      to_text(retrieval_table(methods)) +
      "\nWhat answers say of the pose: right within 0.5 m and 3 degrees, of all revisits; errors where the place "
      "is right, too\n" +
      to_text(pose_table(methods)) +
      "\nTable 2, loop constraints (as accepted; time of verification), of what was verified\n" +
      to_text(loop_table(methods)) + "\n";
  for (const MethodReport& method : methods) text += method.name + ": " + method.source + "\n";
  return text;
}

std::string pairs_to_text(const std::vector<MethodReport>& methods) {
  Table table = {{"", "pairs of one place", "F1max", "EP"}};
  for (const MethodReport& method : methods)
    if (method.pairs.revisits > 0)
      table.push_back({method.name, std::to_string(method.pairs.revisits), format("%.3f", method.pairs.f1_max),
                       format("%.3f", method.pairs.extended_precision)});
  return "Pair lists (below 3 m against beyond 20 m, 1 to 100): retrieval's own scores, another protocol than above\n" +
         to_text(table);
}

std::string pairs_to_csv(const std::vector<MethodReport>& methods) {
  std::string text = "method,pairs_of_one_place,pairs_of_two,f1_max,extended_precision\n";
  for (const MethodReport& method : methods)
    if (method.pairs.revisits > 0)
      text +=
          format("%s,%zu,%zu,%.6f,%.6f\n", method.name.c_str(), method.pairs.revisits,
                 method.pairs.answers - method.pairs.revisits, method.pairs.f1_max, method.pairs.extended_precision);
  return text;
}

std::string to_csv(const std::vector<MethodReport>& methods) {
  std::string text =
      "method,revisits,recall_at_1,f1_max,average_precision,recall_at_p100,extended_precision,reverse_revisits,"
      "reverse_recall_at_1,reverse_recall_at_p100,accepted,false_loops,recall,reverse_recall,median_translation_m,"
      "median_rotation_deg,retrieval_ms,verification_ms,bytes_a_place,gives,scans,right_poses,median_yaw_deg,p95_yaw_"
      "deg,"
      "median_plane_m,p95_plane_m\n";
  // Empty where there is nothing to count.
  const auto number = [](double value, bool is_there) { return is_there ? format(",%.6f", value) : std::string(","); };
  for (const MethodReport& method : methods) {
    const RetrievalTable &all = method.evaluation.retrieval, &reverse = method.evaluation.reverse_retrieval;
    const LoopTable& t = method.evaluation.loops;
    text += method.name + "," + std::to_string(all.revisits);
    for (const double value :
         {all.recall_at_1, all.f1_max, all.average_precision, all.recall_at_p100, all.extended_precision})
      text += number(value, all.revisits > 0);
    text += "," + std::to_string(reverse.revisits) + number(reverse.recall_at_1, reverse.revisits > 0) +
            number(reverse.recall_at_p100, reverse.revisits > 0);
    text += method.is_verified ? format(",%zu,%zu", t.accepted, t.false_loops) : std::string(",,");
    text += number(t.recall, method.is_verified && t.revisits > 0) +
            number(t.reverse_recall, method.is_verified && t.reverse_revisits > 0) +
            number(t.median_translation_m, method.is_verified && t.accepted > 0) +
            number(t.median_rotation_deg, method.is_verified && t.accepted > 0) +
            number(method.retrieval_ms, method.retrieval_ms > 0.0) +
            number(method.verification_ms, method.verification_ms > 0.0) +
            (method.bytes_a_place > 0 ? "," + std::to_string(method.bytes_a_place) : ",");
    const bool has_yaw = method.poses.answers > 0 && method.gives >= Baseline::Gives::kYaw;
    const bool has_plane = method.poses.revisits > 0 && method.gives >= Baseline::Gives::kPlanarPose;
    text += "," + gives(method) + "," + std::to_string(method.scans) + number(right_poses(method.poses), has_plane) +
            number(method.poses.median_yaw_deg, has_yaw) + number(method.poses.p95_yaw_deg, has_yaw) +
            number(method.poses.median_plane_m, has_plane) + number(method.poses.p95_plane_m, has_plane) + "\n";
  }
  return text;
}

std::string to_latex(const std::vector<MethodReport>& methods) {
  return to_latex(retrieval_table(methods)) + "\n" + to_latex(pose_table(methods)) + "\n" +
         to_latex(loop_table(methods));
}

std::string to_json(const std::vector<MethodReport>& methods) {
  nlohmann::ordered_json document = nlohmann::ordered_json::object();
  for (const MethodReport& method : methods) {
    auto entry = nlohmann::ordered_json::parse(to_json(method.evaluation));
    if (!method.is_verified) entry.erase("table_2");
    entry["source"] = method.source;
    entry["retrieval_ms"] = method.retrieval_ms;
    entry["verification_ms"] = method.verification_ms;
    entry["bytes_a_place"] = method.bytes_a_place;
    entry["gives"] = gives(method);
    entry["scans"] = method.scans;
    if (method.poses.answers > 0 && method.gives >= Baseline::Gives::kYaw)
      entry["yaw_deg"] = {{"median", method.poses.median_yaw_deg}, {"p95", method.poses.p95_yaw_deg}};
    if (method.poses.answers > 0 && method.gives >= Baseline::Gives::kPlanarPose) {
      entry["plane_m"] = {{"median", method.poses.median_plane_m}, {"p95", method.poses.p95_plane_m}};
      entry["right_poses"] = right_poses(method.poses);
    }
    document[method.name] = std::move(entry);
  }
  return document.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

Status draw_comparison(const std::filesystem::path& file, const std::vector<MethodReport>& methods) {
  // Seven that colour-blind people tell apart (Okabe and Ito), then the same, dashed.
  constexpr std::array kColours{Colour{0.84, 0.37, 0.00}, Colour{0.00, 0.45, 0.70}, Colour{0.35, 0.70, 0.90},
                                Colour{0.90, 0.60, 0.00}, Colour{0.00, 0.62, 0.45}, Colour{0.80, 0.47, 0.65},
                                Colour{0.30, 0.30, 0.30}};
  std::vector<Curve> curves;
  for (std::size_t i = 0; i < methods.size(); ++i)
    curves.push_back({methods[i].name, &methods[i].evaluation.retrieval, kColours[i % kColours.size()],
                      i / kColours.size() % 2 == 1});
  return draw_precision_recall(file, curves);
}

}  // namespace revisit::cli
