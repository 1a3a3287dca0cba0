// SPDX-License-Identifier: Apache-2.0
#include <iostream>
#include <memory>
#include <optional>

#include <revisit/io/pose_file.hpp>
#include <revisit/io/result_files.hpp>

#include "common.hpp"
#include "evaluation_pictures.hpp"
#include "report.hpp"
#include "run_file.hpp"

namespace revisit::cli {
namespace {

namespace fs = std::filesystem;

struct Options {
  std::string results, reference, recording, calibration;
  std::optional<int> exclude_frames;
  std::optional<double> exclude_s;
};

using Stamps = std::vector<std::pair<FrameId, double>>;

// LiDAR poses of the recording's frames from a pose file. Without the recording every row is a frame of its own, 0.1 s
// apart, unless a times.txt stands beside the file.
Result<Trajectory> load_reference(const Options& options, const Recording* recording) {
  if (fs::is_directory(options.reference)) {
    const auto other = open_recording(options.reference, print_log());
    if (!other) return other.error();
    if ((*other)->trajectory().empty()) return Error{options.reference + ": this recording has no poses"};
    return (*other)->trajectory();
  }
  const auto poses = read_poses(options.reference);
  if (!poses) return poses.error();
  std::optional<Pose> T_camera_lidar;
  if (poses->format == PoseFormat::kKitti) {
    const fs::path beside = fs::path(options.reference).parent_path() / "calib.txt";
    const std::string file = !options.calibration.empty() ? options.calibration
                             : fs::exists(beside)         ? beside.string()
                                                          : "";
    if (!file.empty()) {
      const auto calibration = read_camera_calibration(file);
      if (!calibration) return calibration.error();
      T_camera_lidar = *calibration;
    } else if (recording != nullptr && recording->T_camera_lidar()) {
      T_camera_lidar = recording->T_camera_lidar();
    } else {
      print_log()(LogLevel::kWarning, options.reference +
                                          ": no calib.txt beside it: its poses are taken as poses of the LiDAR. Name "
                                          "the calibration of a KITTI sequence with --camera-calibration");
    }
  }
  Stamps stamps;
  if (recording != nullptr) {
    for (std::size_t i = 0; i < recording->size(); ++i) stamps.emplace_back(recording->frame(i), recording->stamp_s(i));
  } else if (poses->format == PoseFormat::kTum) {
    for (std::size_t i = 0; i < poses->rows.size(); ++i)
      stamps.emplace_back(FrameId{static_cast<std::int64_t>(i)}, *poses->rows[i].stamp_s);
    print_log()(LogLevel::kWarning, "the recording is unknown: row i of " + options.reference + " is taken as frame i");
  }
  Trajectory trajectory = to_trajectory(*poses, T_camera_lidar, stamps);
  // Frames that the recording leaves out can neither ask nor answer.
  if (recording != nullptr) {
    Trajectory present;
    for (const auto& [frame, stamp_s] : stamps)
      if (const auto found = trajectory.entries.find(frame); found != trajectory.entries.end())
        present.entries.insert(*found);
    trajectory = std::move(present);
  }
  if (trajectory.empty()) return Error{options.reference + ": no pose belongs to a frame of the recording"};
  return trajectory;
}

int evaluate(const Options& options) {
  const fs::path folder = options.results;
  const auto candidates = read_candidates(folder / "candidates.csv");
  if (!candidates) return fail(candidates.error());
  const auto loops = read_loops(folder / "loops.csv");
  if (!loops) return fail(loops.error());
  RunFacts facts;
  if (fs::exists(folder / "run.json")) {
    const auto run = read_run(folder / "run.json");
    if (!run) return fail(run.error());
    facts = *run;
  }
  if (!facts.database.empty())
    return fail({options.results + ": was matched against another recording (" + facts.database +
                 "); only loops within one recording can be evaluated"});

  const std::string recording_folder = !options.recording.empty() ? options.recording : facts.input;
  std::unique_ptr<Recording> recording;
  if (!recording_folder.empty() && fs::exists(recording_folder)) {
    auto opened = open_recording(recording_folder, print_log());
    if (!opened) return fail(opened.error());
    recording = *std::move(opened);
  } else if (!options.recording.empty()) {
    return fail({options.recording + ": no such folder"});
  } else {
    print_log()(LogLevel::kWarning, "the recording is not there: every pose of the reference counts as a frame of it");
  }

  EvaluationReport report;
  report.results = options.results;
  report.reference = options.reference;
  // The same frames must be allowed here as were searched.
  report.rules.exclude_frames =
      options.exclude_frames.value_or(facts.exclude_frames.value_or(report.rules.exclude_frames));
  report.rules.exclude_s = options.exclude_s.value_or(facts.exclude_s.value_or(report.rules.exclude_s));
  const auto trajectory = load_reference(options, recording.get());
  if (!trajectory) return fail(trajectory.error());
  const Reference reference(*trajectory, report.rules);
  report.retrieval = evaluate_retrieval(*candidates, reference);
  report.reverse_retrieval = evaluate_retrieval(*candidates, reference, RevisitKind::kReverse);
  report.loops = evaluate_loops(*loops, reference);

  std::cout << to_text(report);
  for (const Status& status :
       {draw_precision_recall(folder / "precision_recall.png", report.retrieval, report.reverse_retrieval),
        draw_trajectory(folder / "trajectory.png", reference, report.loops),
        write_text(folder / "evaluation.json", to_json(report)), write_text(folder / "report.html", to_html(report))})
    if (!status) return fail(status.error());
  std::cout << "Report: " << (folder / "report.html").string() << '\n';
  return kDone;
}

}  // namespace

Run add_evaluate(CLI::App& program) {
  auto options = std::make_shared<Options>();
  CLI::App* command = program.add_subcommand("evaluate", "Score results against reference poses, and draw them.");
  command->footer(
      "Prints table 1 (retrieval) and table 2 (loop constraints), and writes into DIR: report.html,\n"
      "precision_recall.png, trajectory.png, evaluation.json. Works on the files of any program that writes\n"
      "candidates.csv and loops.csv (docs/formats.md).\n\n"
      "Example: revisit evaluate results/00 --reference kitti/poses/00.txt --camera-calibration "
      "kitti/sequences/00/calib.txt");
  command->add_option("results", options->results, "Folder that `revisit detect` wrote")->required();
  command
      ->add_option("--reference", options->reference,
                   "Reference poses: a KITTI, TUM or g2o file, or a recording that has poses")
      ->required();
  command->add_option("--recording", options->recording, "The recording, where it is not where run.json says");
  command->add_option("--camera-calibration", options->calibration,
                      "calib.txt with the row Tr, for poses of a KITTI camera (default: beside the poses)");
  command->add_option("--exclude-frames", options->exclude_frames,
                      "Frames a match must be older (default: as searched, else 50)");
  command->add_option("--exclude-s", options->exclude_s,
                      "Seconds a match must be older (default: as searched, else 30)");
  return [options] { return evaluate(*options); };
}

}  // namespace revisit::cli
