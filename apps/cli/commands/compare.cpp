// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <iostream>
#include <memory>
#include <optional>

#include <revisit/core/stopwatch.hpp>
#include <revisit/io/result_files.hpp>
#include <revisit/pipeline/loop_detector.hpp>
#include <revisit/pipeline/recording_scale.hpp>
#include <revisit/retrieval/baseline_search.hpp>

#include "common.hpp"
#include "progress.hpp"
#include "read_ahead.hpp"
#include "reports/comparison.hpp"

namespace revisit::cli {
namespace {

namespace fs = std::filesystem;

constexpr const char *kOurs = "revisit", *kPaper = "isc-paper";

struct CompareOptions {
  std::string input, out, poses;
  std::vector<std::string> methods;
  bool overwrite = false;
  InputFlags recording;
  ParameterFlags parameters;
};

// A method at work: what it answers goes into a folder of its own, in the form of `revisit detect`.
struct Method {
  MethodReport report;
  std::unique_ptr<LoopDetector> detector;    // one of the two
  std::unique_ptr<BaselineSearch> baseline;  // is there
  std::optional<ResultWriter> writer;
  double ms = 0.0;
};

std::vector<std::string> method_names() {
  std::vector<std::string> names{kOurs, kPaper};
  for (const auto& baseline : make_baselines()) names.push_back(baseline->name());
  return names;
}

Result<std::vector<Method>> make_methods(const CompareOptions& options, const Parameters& parameters,
                                         const IntensityScale& scale) {
  const auto is_wanted = [&](const std::string& name) {
    return options.methods.empty() ||
           std::find(options.methods.begin(), options.methods.end(), name) != options.methods.end();
  };
  std::vector<Method> methods;
  const auto add = [&](const std::string& name, const std::string& source) -> Method& {
    Method& method = methods.emplace_back();
    method.report.name = name;
    method.report.source = source;
    return method;
  };
  if (is_wanted(kOurs)) {
    Method& method = add(kOurs, "this program, with the parameters given");
    method.detector = std::make_unique<LoopDetector>(parameters, scale);
  }
  if (is_wanted(kPaper)) {
    Parameters as_printed = *preset("paper");
    static_cast<ExclusionRule&>(as_printed.retrieval) = parameters.retrieval;
    Method& method = add(kPaper, "Wang et al., ICRA 2020, as in the paper (preset `paper`)");
    method.detector = std::make_unique<LoopDetector>(as_printed, scale);
  }
  for (auto& baseline : make_baselines()) {
    if (!is_wanted(baseline->name())) continue;
    Method& method = add(baseline->name(), baseline->source());
    method.baseline = std::make_unique<BaselineSearch>(std::move(baseline), parameters.retrieval);
  }
  for (Method& method : methods) {
    method.report.gives_poses = method.detector != nullptr;
    auto writer =
        ResultWriter::create(fs::path(options.out) / method.report.name,
                             options.overwrite ? ResultWriter::Existing::kReplace : ResultWriter::Existing::kRefuse);
    if (!writer) return writer.error();
    method.writer = *std::move(writer);
  }
  return methods;
}

Status answer(Method& method, Scan scan, const std::optional<PreparedScan>& prepared) {
  Stopwatch watch;
  if (method.detector) {
    const auto detection = method.detector->process(std::move(scan));
    method.ms += watch.lap_ms();
    if (!detection || detection->searchable_places == 0) return ok();  // a scan that shows no place has no answer
    if (const Status status = method.writer->add(detection->row()); !status) return status;
    return detection->loop ? method.writer->add(*detection->loop) : ok();
  }
  if (!prepared) return ok();
  const auto row = method.baseline->process({prepared->scan.frame, prepared->scan.stamp_s}, prepared->scan.points,
                                            prepared->ground_z_m);
  method.ms += watch.lap_ms();
  return row ? method.writer->add(*row) : ok();
}

// The number of scans that could not be read.
Result<std::size_t> run_all(std::vector<Method>& methods, const Recording& recording, const Parameters& parameters,
                            const IntensityScale& scale) {
  std::size_t skipped = 0;
  Progress progress("compare", "scans", recording.size());
  ReadAhead scans(recording);
  const bool has_baselines =
      std::any_of(methods.begin(), methods.end(), [](const Method& m) { return m.baseline != nullptr; });
  for (std::size_t i = 0; i < recording.size() && !interrupted(); ++i) {
    const auto scan = scans.next();
    progress.update(i + 1);
    if (!scan) {
      progress.clear();
      print_log()(LogLevel::kWarning, scan.error().message + "; skipped");
      ++skipped;
      continue;
    }
    std::optional<PreparedScan> prepared;
    if (has_baselines)
      if (auto made = prepare_scan(*scan, parameters, scale)) prepared = *std::move(made);
    for (Method& method : methods)
      if (const Status status = answer(method, *scan, prepared); !status) return status.error();
  }
  return skipped;
}

Status evaluate_all(std::vector<Method>& methods, const Recording& recording, const Parameters& parameters,
                    const CompareOptions& options) {
  const EvaluationRules rules{parameters.retrieval};
  const Reference reference(recording.trajectory(), rules);
  for (Method& method : methods) {
    if (const Status status = method.writer->finish(); !status) return status;
    const fs::path folder = fs::path(options.out) / method.report.name;
    const auto candidates = read_candidates(folder / "candidates.csv");
    const auto loops = read_loops(folder / "loops.csv");
    if (!candidates) return candidates.error();
    if (!loops) return loops.error();
    method.report.ms_per_scan = method.ms / static_cast<double>(std::max<std::size_t>(1, recording.size()));
    method.report.evaluation = {folder.string(),
                                options.poses.empty() ? options.input : options.poses,
                                rules,
                                evaluate_retrieval(*candidates, reference),
                                evaluate_retrieval(*candidates, reference, RevisitKind::kReverse),
                                evaluate_loops(*loops, reference),
                                {}};
  }
  return ok();
}

int compare(const CompareOptions& options) {
  auto parameters = options.parameters.resolve();
  if (!parameters) return fail(parameters.error(), kUsage);
  const auto recording = open_input(options.input, options.recording.options(options.poses), &*parameters);
  if (!recording) return fail(recording.error());
  if ((*recording)->trajectory().empty())
    return fail({options.input + ": has no poses to judge the methods by; name a pose file with --poses"});
  use_frames_alone_without_times(**recording, *parameters);
  const auto scale = intensity_scale_of(**recording, parameters->intensity);
  if (!scale) return fail({scale.error().message + "; no scan can be used"});
  auto methods = make_methods(options, *parameters, *scale);
  if (!methods) return fail(methods.error());

  listen_for_interrupt();
  const auto skipped = run_all(*methods, **recording, *parameters, *scale);
  if (!skipped) return fail(skipped.error());
  if (interrupted()) print_log()(LogLevel::kWarning, "interrupted: frames that were not reached count as missed");
  if (const Status status = evaluate_all(*methods, **recording, *parameters, options); !status)
    return fail(status.error());
  std::vector<MethodReport> reports;
  reports.reserve(methods->size());
  for (Method& method : *methods) reports.push_back(std::move(method.report));
  std::cout << to_text(reports);
  const fs::path out = options.out;
  for (const Status& status :
       {write_text(out / "comparison.txt", to_text(reports)), write_text(out / "comparison.json", to_json(reports)),
        draw_comparison(out / "precision_recall.png", reports)})
    if (!status) return fail(status.error());
  std::cout << "Picture: " << (out / "precision_recall.png").string() << '\n';
  if (interrupted()) return kInterrupted;
  return *skipped == 0 ? kDone : kDoneWithReservations;
}

}  // namespace

Run add_compare(CLI::App& program) {
  auto options = std::make_shared<CompareOptions>();
  CLI::App* command =
      program.add_subcommand("compare", "Run several published methods over a recording, side by side.");
  std::string footer =
      "Prints tables 1 and 2 (docs/evaluation.md) with a row a method, judged by the poses of the recording, and "
      "writes\n"
      "comparison.txt, comparison.json, precision_recall.png and a folder a method with its candidates.csv and\n"
      "loops.csv. Each method takes the same scans and may answer with the same earlier ones.\n\n"
      "Methods:\n"
      "  revisit                this program, with the parameters given\n"
      "  isc-paper              Intensity Scan Context as in the paper\n";
  for (const auto& baseline : make_baselines())
    footer += "  " + baseline->name() + std::string(23 - std::min<std::size_t>(22, baseline->name().size()), ' ') +
              baseline->source() + "\n";
  command->footer(footer + "\nExample: revisit compare kitti/sequences/00 --poses kitti/poses/00.txt --out compared");
  command->add_option("input", options->input, "Recording with poses, or .toml of a simulated drive")->required();
  command->add_option("--out", options->out, "Folder for the results")->required();
  command->add_option("--methods", options->methods, "Only these (separated by commas); default: all")
      ->delimiter(',')
      ->check(CLI::IsMember(method_names()));
  command->add_option("--poses", options->poses, "Pose file (KITTI, TUM, g2o), instead of the recording's own poses");
  command->add_flag("--overwrite", options->overwrite, "Replace results that are already in the folder");
  options->recording.add_to(*command);
  options->parameters.add_to(*command);
  return [options] { return compare(*options); };
}

}  // namespace revisit::cli
