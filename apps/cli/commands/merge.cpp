// SPDX-License-Identifier: Apache-2.0
#include <iostream>
#include <memory>
#include <optional>
#include <set>

#include <revisit/core/stopwatch.hpp>
#include <revisit/pipeline/merge_maps.hpp>
#include <revisit/store/map_store.hpp>

#include "common.hpp"
#include "progress.hpp"
#include "reports/evidence_file.hpp"
#include "reports/table.hpp"

namespace revisit::cli {
namespace {

namespace fs = std::filesystem;

struct MergeOptions {
  std::vector<std::string> maps;
  std::string out;
  ParameterFlags parameters;
};

// What is known of loops within the maps comes along.
Status add_rows(const std::vector<fs::path>& maps, const MergeReport& report, EvidenceFile& evidence) {
  std::size_t next = 0;
  for (const MergeReport::Session& session : report.sessions) {
    if (session.map != next) continue;  // a further one of the same map
    if (const Status status = evidence.add_rows_of(MapStore::file_of(maps[next++]), session.id); !status) return status;
  }
  return ok();
}

int merge(const MergeOptions& options) {
  const auto parameters = options.parameters.resolve();
  if (!parameters) return fail(parameters.error(), kUsage);
  if (const Status status = check_output(options.out, ".revisit"); !status) return fail(status.error(), kUsage);
  const std::vector<fs::path> maps(options.maps.begin(), options.maps.end());
  listen_for_interrupt();
  std::unique_ptr<Progress> progress;
  std::optional<EvidenceFile> evidence;  // begun once there is something to merge
  const auto report = merge_maps(
      maps, options.out, *parameters, print_log(),
      [&](std::size_t done, std::size_t of) {
        if (!progress) progress = std::make_unique<Progress>("merge", "key frames", of);
        progress->update(done);
        return !interrupted();
      },
      [&](const Detection& detection) {
        if (!evidence) evidence = EvidenceFile::of_map(options.out, FrameId{-1});
        return evidence->add(detection);
      });
  progress.reset();
  if (const Status status = report && evidence ? add_rows(maps, *report, *evidence) : ok(); !status)
    return fail(status.error());
  if (std::error_code ignored; !report && evidence) fs::remove(evidence_of_map(options.out), ignored);
  if (!report) return fail(report.error(), interrupted() ? kInterrupted : kFailed);

  Table table = {{"session", "recording", "key frames", "loops to other sessions", "part of the map"}};
  std::set<int> parts;
  for (const MergeReport::Session& each : report->sessions) {
    parts.insert(each.parts.begin(), each.parts.end());
    std::string of_session;
    for (const int part : each.parts) of_session += (of_session.empty() ? "" : ", ") + std::to_string(part);
    table.push_back({std::to_string(each.id), each.recording, std::to_string(each.keyframes),
                     std::to_string(each.loops), of_session});
  }
  std::cout << to_text(table) << "Map: " << options.out << '\n';
  if (parts.size() > 1)
    print_log()(LogLevel::kWarning, "no loops join all sessions: the map has " + std::to_string(parts.size()) +
                                        " parts, each with coordinates of its own; a recording that passes through "
                                        "several of them joins them (slam --into)");
  return kDone;
}

}  // namespace

Run add_merge(CLI::App& program) {
  auto options = std::make_shared<MergeOptions>();
  CLI::App* command = program.add_subcommand("merge", "Make one map of several.");
  command->footer(
      "The sessions of the maps may be of other days, robots and sensors, and may have started anywhere: they are "
      "joined by\n"
      "loops that agree with each other. Those that have nothing in common stay apart, in the same file. The maps are "
      "only read.\n\n"
      "Example: revisit merge maps/monday maps/tuesday maps/robot2 --out site.revisit");
  command->add_option("maps", options->maps, "Maps: files, or folders of `revisit slam --out`")->required();
  command->add_option("--out", options->out, "The new map, NAME.revisit")->required();
  options->parameters.add_to(*command);
  return [options] { return merge(*options); };
}

}  // namespace revisit::cli
