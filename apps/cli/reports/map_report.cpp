// SPDX-License-Identifier: Apache-2.0
#include <nlohmann/json.hpp>

#include <revisit/core/text.hpp>

#include "reports/report.hpp"
#include "reports/table.hpp"

namespace revisit::cli {

std::string to_text(const WakingTable& table, std::size_t keyframes) {
  const Table rows = {
      {"scans", "in the map", "answered and right", "not in the map", "false answers", "of these not in the map",
       "error median", "95 %", "median", "time median", "99 %"},
      {std::to_string(table.scans), std::to_string(table.in_map),
       table.in_map == 0 ? "-" : format("%.4f", table.share()), std::to_string(table.outside),
       std::to_string(table.false_answers), std::to_string(table.false_outside), format("%.3f m", table.median_error_m),
       format("%.3f m", table.p95_error_m), format("%.2f deg", table.median_error_deg),
       format("%.1f ms", table.median_ms), format("%.1f ms", table.p99_ms)}};
  std::string text = "Table 5, waking up in a map of " + std::to_string(keyframes) + " key frames\n" + to_text(rows);
  text += "Scans:";
  for (const auto& [status, count] : table.statuses) text += " " + status + " " + std::to_string(count);
  text += "\n";
  if (table.false_frames.empty()) return text;
  text += "False answers at frames";
  constexpr std::size_t kMost = 20;
  for (std::size_t i = 0; i < table.false_frames.size() && i < kMost; ++i)
    text += " " + std::to_string(table.false_frames[i].value);
  return text + (table.false_frames.size() > kMost ? " ...\n" : "\n");
}

std::string to_json(const WakingTable& table, std::size_t keyframes) {
  nlohmann::ordered_json json;
  json["map_keyframes"] = keyframes;
  json["scans"] = table.scans;
  json["in_map"] = table.in_map;
  json["right"] = table.right;
  json["share_right"] = table.share();
  json["not_in_map"] = table.outside;
  json["answered"] = table.answered;
  json["false_answers"] = table.false_answers;
  json["false_answers_not_in_map"] = table.false_outside;
  json["median_error_m"] = table.median_error_m;
  json["p95_error_m"] = table.p95_error_m;
  json["median_error_deg"] = table.median_error_deg;
  json["median_ms"] = table.median_ms;
  json["p99_ms"] = table.p99_ms;
  json["statuses"] = table.statuses;
  return json.dump(2) + "\n";
}

std::string to_text(const SessionTable& table) {
  Table rows = {{"session", "key frames", "part", "ATE alone", "ATE with the first of its part", ""}};
  for (const SessionTable::Session& each : table.sessions)
    rows.push_back({std::to_string(each.id), std::to_string(each.keyframes), std::to_string(each.part),
                    format("%.3f m", each.ate_alone_m), format("%.3f m", each.ate_joined_m),
                    each.is_wrong ? "wrong join" : ""});
  std::string text = "Table 6, sessions made one\n" + to_text(rows);
  text += std::to_string(table.joined) + " of " + std::to_string(table.sessions.size()) +
          " sessions in the first part, " + std::to_string(table.wrong_joins) +
          " wrong joins; ATE of all sessions together:";
  for (const auto& [part, ate_m] : table.ate_m) text += format(" %.3f m (part %d)", ate_m, part);
  return text + "\n";
}

}  // namespace revisit::cli
