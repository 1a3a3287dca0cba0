// SPDX-License-Identifier: Apache-2.0
#include "reports/run_file.hpp"

#include <cmath>
#include <fstream>

#include <nlohmann/json.hpp>

#include <revisit/io/result_files.hpp>

namespace revisit::cli {

Status write_run(const std::filesystem::path& file, const RunFile& run) {
  nlohmann::ordered_json document = {{"program", "revisit"},
                                     {"version", REVISIT_VERSION},
                                     {"command", run.command},
                                     {"input", run.input},
                                     {"topic", run.topic},
                                     {"database", run.database},
                                     {"poses", run.poses},
                                     {"calibration", run.calibration},
                                     {"arguments", run.arguments},
                                     {"interrupted", run.interrupted},
                                     {"parameters", nlohmann::ordered_json::object()}};
  const bool is_simulated = std::filesystem::path(run.input).extension() == ".toml";
  for (const ParameterInfo& info : parameter_infos()) {
    const std::string value = get_parameter(run.parameters, info.name);
    if (info.name.starts_with("simulation.") && !is_simulated) continue;
    document["parameters"][info.name] =
        info.is_text ? nlohmann::ordered_json(value) : nlohmann::ordered_json::parse(value);
  }
  document["intensity"] = {{"min", run.intensity.min_raw},
                           {"median", run.intensity.median_raw},
                           {"max", run.intensity.max_raw},
                           {"full_scale", run.intensity.full_scale},
                           {"is_reflectance", run.intensity.is_reflectance},
                           {"warning", run.intensity.warning}};
  document["counts"] = run.counts;
  const auto found = run.counts.find("scans");
  const double scans = found == run.counts.end() ? 0.0 : static_cast<double>(found->second);
  for (const auto& [stage, ms] : run.ms_total) document["ms_per_scan"][stage] = scans > 0.0 ? ms / scans : 0.0;
  document["memory_mb"] = nlohmann::ordered_json::array();
  for (const auto& [scan, mb] : run.memory.samples())
    document["memory_mb"].push_back({scan, std::round(10.0 * mb) / 10.0});
  document["skipped"] = run.skipped;
  if (run.command == "slam") document["untracked"] = run.untracked;
  return write_text(file, document.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n");
}

Result<RunFacts> read_run(const std::filesystem::path& file) {
  std::ifstream stream(file);
  if (!stream) return Error{file.string() + ": cannot be opened"};
  const auto document = nlohmann::json::parse(stream, nullptr, false);
  if (!document.is_object()) return Error{file.string() + ": is no JSON object"};
  RunFacts facts;
  try {
    facts.input = document.value("input", "");
    facts.topic = document.value("topic", "");
    facts.database = document.value("database", "");
    facts.calibration = document.value("calibration", "");
    facts.interrupted = document.value("interrupted", false);
    const auto parameters = document.value("parameters", nlohmann::json::object());
    for (const auto& [name, value] : parameters.items())
      static_cast<void>(
          set_parameter(facts.parameters, name, value.is_string() ? value.get<std::string>() : value.dump()));
    if (parameters.contains("retrieval.exclude_frames"))
      facts.exclude_frames = parameters.at("retrieval.exclude_frames").get<int>();
    if (parameters.contains("retrieval.exclude_s"))
      facts.exclude_s = parameters.at("retrieval.exclude_s").get<double>();
  } catch (const nlohmann::json::exception& problem) {
    return Error{file.string() + ": " + problem.what()};
  }
  return facts;
}

}  // namespace revisit::cli
