// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cctype>
#include <iostream>
#include <memory>
#include <optional>

#include <revisit/io/result_files.hpp>
#include <revisit/pipeline/recording_scale.hpp>

#include "common.hpp"
#include "methods.hpp"
#include "progress.hpp"
#include "read_ahead.hpp"
#include "reports/comparison.hpp"
#include "reports/method_page.hpp"

namespace revisit::cli {
namespace {

namespace fs = std::filesystem;

struct CompareOptions {
  std::string input, out, poses;
  std::vector<std::string> methods, plugins, candidates;
  bool verify = false, pairs = false, overwrite = false;
  InputFlags recording;
  ParameterFlags parameters;
};

struct Reached {
  std::size_t scans = 0, skipped = 0;  ///< skipped: could not be read
};

Result<Reached> run_all(Methods& methods, const Recording& recording) {
  Reached run;
  Progress progress("compare", "scans", recording.size());
  ReadAhead scans(recording);
  for (std::size_t i = 0; i < recording.size() && !interrupted(); ++i) {
    ++run.scans;
    const auto scan = scans.next();
    progress.update(i + 1);
    if (!scan) {
      progress.clear();
      print_log()(LogLevel::kWarning, scan.error().message + "; skipped");
      ++run.skipped;
      continue;
    }
    if (const Status status = methods.answer(*scan, i); !status) return status.error();
  }
  return run;
}

Result<EvaluationReport> evaluate(const fs::path& candidates_file, const std::vector<CandidateRow>& candidates,
                                  const std::optional<fs::path>& loops_file, const Reference& reference,
                                  const CompareOptions& options, const EvaluationRules& rules) {
  const auto loops = loops_file ? read_loops(*loops_file) : Result(std::vector<LoopConstraint>{});
  if (!loops) return loops.error();
  return EvaluationReport{candidates_file.parent_path().string(),
                          options.poses.empty() ? options.input : options.poses,
                          rules,
                          evaluate_retrieval(candidates, reference),
                          evaluate_retrieval(candidates, reference, RevisitKind::kReverse),
                          evaluate_loops(*loops, reference),
                          {}};
}

Trajectory first_poses(const Recording& recording, std::size_t scans) {
  Trajectory poses = recording.trajectory();
  if (scans < recording.size())
    poses.entries.erase(poses.entries.lower_bound(recording.frame(scans)), poses.entries.end());
  return poses;
}

// By the scans that were reached. Those that ran here, and then those whose answers come from elsewhere.
Result<std::vector<MethodReport>> evaluate_all(Methods& methods, const Recording& recording, std::size_t reached,
                                               const Parameters& parameters, const CompareOptions& options) {
  const EvaluationRules rules{parameters.retrieval};
  const Reference reference(first_poses(recording, reached), rules);
  const auto scans = static_cast<double>(std::max<std::size_t>(1, reached));
  std::vector<MethodReport> reports;
  for (const auto& method : methods.all()) {
    if (const Status status = method->finish(); !status) return status.error();
    const fs::path folder = fs::path(options.out) / method->report.name;
    const auto candidates = read_candidates(folder / "candidates.csv");
    if (!candidates) return candidates.error();
    auto evaluation = evaluate(folder / "candidates.csv", *candidates, folder / "loops.csv", reference, options, rules);
    if (!evaluation) return evaluation.error();
    MethodReport& report = reports.emplace_back(std::move(method->report));
    report.evaluation = *std::move(evaluation);
    if (const Status status = write_method_page(folder, report.evaluation, *candidates, reference, report.is_verified);
        !status)
      return status.error();
    report.poses =
        evaluate_given_poses(method->given_poses, reference, method->report.gives == Baseline::Gives::kPlanarPose);
    if (!method->pairs.empty()) report.pairs = evaluate_pairs(method->pairs);
    report.retrieval_ms /= scans;
    report.verification_ms /= scans;
  }
  for (const std::string& each : options.candidates) {
    const std::size_t equals = each.find('=');
    const auto candidates = read_candidates(each.substr(equals + 1));
    if (!candidates) return candidates.error();
    auto evaluation = evaluate(each.substr(equals + 1), *candidates, std::nullopt, reference, options, rules);
    if (!evaluation) return evaluation.error();
    MethodReport& report = reports.emplace_back();
    report.name = each.substr(0, equals);
    report.source = each.substr(equals + 1);
    report.evaluation = *std::move(evaluation);
  }
  return reports;
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
  for (const std::string& each : options.candidates)  // not after hours
    if (const auto rows = read_candidates(each.substr(each.find('=') + 1)); !rows) return fail(rows.error());
  const auto* const camera = dynamic_cast<const SimulatedRecording*>(recording->get());
  std::shared_ptr<const Vocabulary> vocabulary;
  for (const std::string& vision : Methods::vision_names()) {
    if (vocabulary || std::find(options.methods.begin(), options.methods.end(), vision) == options.methods.end())
      continue;
    if (camera == nullptr)
      return fail({options.input + ": has no images for " + vision + "; simulated drives (.toml) have"});
    const auto made = vocabulary_beside(*camera);
    if (!made) return fail(made.error());
    vocabulary = *made;
  }
  const PairLists pairs = options.pairs ? make_pair_lists((*recording)->trajectory()) : PairLists{};
  if (options.pairs && pairs.empty()) return fail({options.input + ": no two of its frames are of one place (3 m)"});
  const auto made = Methods::make(
      {options.methods, options.verify, camera, vocabulary, options.pairs ? &pairs : nullptr, options.plugins},
      *parameters, *scale);
  if (!made) return fail(made.error());
  Methods& methods = **made;
  for (const auto& method : methods.all())
    if (const Status status =
            method->open(fs::path(options.out) / method->report.name,
                         options.overwrite ? ResultWriter::Existing::kReplace : ResultWriter::Existing::kRefuse);
        !status)
      return fail(status.error());

  listen_for_interrupt();
  const auto run = run_all(methods, **recording);
  if (!run) return fail(run.error());
  if (interrupted())
    print_log()(LogLevel::kWarning, "interrupted: judged by the first " + std::to_string(run->scans) + " of " +
                                        std::to_string((*recording)->size()) + " scans");
  const auto evaluated = evaluate_all(methods, **recording, run->scans, *parameters, options);
  if (!evaluated) return fail(evaluated.error());
  const std::vector<MethodReport>& reports = *evaluated;
  std::cout << to_text(reports);
  const fs::path out = options.out;
  std::vector<Status> written{
      write_text(out / "comparison.txt", to_text(reports)), write_text(out / "comparison.json", to_json(reports)),
      write_text(out / "comparison.csv", to_csv(reports)), write_text(out / "comparison.tex", to_latex(reports)),
      draw_comparison(out / "precision_recall.png", reports)};
  if (options.pairs) {
    std::cout << '\n' << pairs_to_text(reports);
    written.push_back(write_text(out / "pairs.csv", pairs_to_csv(reports)));
  }
  for (const Status& status : written)
    if (!status) return fail(status.error());
  std::cout << "Picture: " << (out / "precision_recall.png").string() << '\n';
  if (interrupted()) return kInterrupted;
  return run->skipped == 0 ? kDone : kDoneWithReservations;
}

}  // namespace

Run add_compare(CLI::App& program) {
  auto options = std::make_shared<CompareOptions>();
  CLI::App* command =
      program.add_subcommand("compare", "Run several published methods over a recording, side by side.");
  std::string footer =
      "Prints tables 1 and 2 (docs/evaluation.md) with a row a method, judged by the poses of the recording, and\n"
      "writes comparison.txt, .csv, .tex, .json, precision_recall.png and a folder a method with its candidates.csv,\n"
      "loops.csv, precision_recall.csv, failures.csv and a page (report.html). Each method works on one thread, may\n"
      "answer with the same earlier scans, and takes scans that were prepared in the same way (ground, intensity,\n"
      "sweep); isc-paper prepares them by its own preset.\n\n"
      "Methods of your own: a shared library (--plugin; examples/method_plugin.c), revisit.compare(own=...) in\n"
      "Python, or --candidates with the candidates.csv (docs/formats.md) of any program.\n\n"
      "Methods:\n"
      "  revisit                this program, with the parameters given; its scores are those after verification\n"
      "  revisit-retrieval      its index alone: the first answer, unverified\n"
      "  isc-paper              Intensity Scan Context as in the paper\n";
  for (const auto& baseline : all_baselines())
    footer += "  " + baseline->name() + std::string(23 - std::min<std::size_t>(22, baseline->name().size()), ' ') +
              baseline->source() + "\n";
  footer +=
      "By name only, on simulated drives, which have a camera (DBoW2; images take a while to compute):\n"
      "  visual-words, visual-words-night, visual-words-day-night\n";
  command->footer(footer + "\nExample: revisit compare kitti/sequences/00 --poses kitti/poses/00.txt --out compared");
  command->add_option("input", options->input, "Recording with poses, or .toml of a simulated drive")->required();
  command->add_option("--out", options->out, "Folder for the results")->required();
  std::vector<std::string> known = Methods::names();
  for (const std::string& vision : Methods::vision_names()) known.push_back(vision);
  command->add_option("--methods", options->methods, "Only these (separated by commas); default: all")
      ->delimiter(',')
      ->check(CLI::IsMember(known));
  command->add_option(
      "--plugin", options->plugins,
      "Shared library with a method of your own (baseline_plugin.h), beside --methods; may be repeated");
  command->add_flag("--verify", options->verify,
                    "Register what each method answers as this program does, and judge it by table 2");
  command->add_flag("--pairs", options->pairs,
                    "Also the protocol of pair lists (SSC): pairs.csv, with F1max and EP; takes a while");
  command
      ->add_option("--candidates", options->candidates,
                   "NAME=FILE: judge the candidates.csv of another program beside them; may be repeated")
      ->check([known](const std::string& text) {
        const std::size_t equals = text.find('=');
        if (equals == std::string::npos || equals == 0) return std::string("NAME=FILE is wanted");
        const std::string name = text.substr(0, equals);
        if (std::any_of(name.begin(), name.end(),
                        [](unsigned char c) { return std::isalnum(c) == 0 && c != '-' && c != '+' && c != '.'; }))
          return name + ": allowed in a name: letters, digits, - + .";
        return std::find(known.begin(), known.end(), name) == known.end() ? std::string() : name + ": is taken";
      });
  command->add_option("--poses", options->poses, "Pose file (KITTI, TUM, g2o), instead of the recording's own poses");
  command->add_flag("--overwrite", options->overwrite, "Replace results that are already in the folder");
  options->recording.add_to(*command);
  options->parameters.add_to(*command);
  return [options] { return compare(*options); };
}

}  // namespace revisit::cli
