// SPDX-License-Identifier: Apache-2.0
#include <iostream>
#include <map>
#include <memory>
#include <optional>

#include <revisit/io/pose_file.hpp>
#include <revisit/io/result_files.hpp>
#include <revisit/localisation/saved_map.hpp>
#include <revisit/store/map_store.hpp>

#include "common.hpp"
#include "pictures/evaluation_pictures.hpp"
#include "pictures/trajectory_pictures.hpp"
#include "reports/report.hpp"
#include "reports/run_file.hpp"

namespace revisit::cli {
namespace {

namespace fs = std::filesystem;

struct EvaluateOptions {
  std::string results, reference, recording, calibration;
  std::vector<std::string> map_references;
  bool is_elsewhere = false;
  std::optional<int> exclude_frames;
  std::optional<double> exclude_s;
};

// The calibration of a camera that KITTI poses belong to: as named, beside the poses, or the recording's own.
Result<std::optional<Pose>> find_camera_calibration(const EvaluateOptions& options, const Recording* recording) {
  const fs::path beside = fs::path(options.reference).parent_path() / "calib.txt";
  std::error_code failure;
  const fs::path file = !options.calibration.empty() ? fs::path(options.calibration) : beside;
  if (!options.calibration.empty() || fs::exists(beside, failure)) {
    const auto calibration = read_camera_calibration(file);
    if (!calibration) return calibration.error();
    return std::optional<Pose>(*calibration);
  }
  if (recording != nullptr && recording->T_camera_lidar()) return recording->T_camera_lidar();
  print_log()(LogLevel::kWarning, options.reference +
                                      ": no calib.txt beside it: its poses are taken as poses of the LiDAR. Name the "
                                      "calibration of a KITTI sequence with --camera-calibration");
  return std::optional<Pose>();
}

// LiDAR poses of the recording's frames. Without the recording every row of the reference is a frame, 0.1 s apart.
Result<Trajectory> load_reference(const EvaluateOptions& options, const Recording* recording) {
  Trajectory all;
  std::error_code failure;
  if (fs::is_directory(options.reference, failure) || fs::path(options.reference).extension() == ".toml") {
    const auto other = open_input(options.reference);
    if (!other) return other.error();
    all = (*other)->trajectory();
  } else {
    const auto poses = read_poses(options.reference);
    if (!poses) return poses.error();
    if (poses->format == PoseFormat::kTum && recording == nullptr)
      return Error{options.reference +
                   ": TUM poses go by time, and the times are the recording's: name it with --recording"};
    Result<std::optional<Pose>> T_camera_lidar = std::optional<Pose>();
    if (poses->format == PoseFormat::kKitti) T_camera_lidar = find_camera_calibration(options, recording);
    if (!T_camera_lidar) return T_camera_lidar.error();
    all = to_trajectory(*poses, *T_camera_lidar, recording == nullptr ? Stamps() : stamps_of(*recording));
  }
  if (all.empty()) return Error{options.reference + ": holds no pose for a frame of the recording"};
  if (recording == nullptr) return all;
  // Frames that the recording leaves out are neither queries nor answers.
  Trajectory present;
  for (const auto& [frame, stamp_s] : stamps_of(*recording))
    if (const auto pose = all.at(frame)) present.entries[frame] = {stamp_s, *pose};
  if (present.empty()) return Error{options.reference + ": holds no pose for a frame of the recording"};
  if (2 * present.entries.size() < recording->size())
    print_log()(LogLevel::kWarning, options.reference + ": has poses for " + std::to_string(present.entries.size()) +
                                        " of " + std::to_string(recording->size()) +
                                        " frames: does it belong to another recording?");
  return present;
}

// `revisit slam` queries and answers with key frames: only these count in tables 1 and 2.
Result<Trajectory> queried_frames(const fs::path& folder, const Trajectory& reference) {
  std::error_code failure;
  const fs::path map = MapStore::file_of(folder);
  if (!fs::exists(map, failure)) return reference;
  const auto store = MapStore::open(map, MapStore::Access::kRead);
  if (!store) return store.error();
  const auto keyframes = store->keyframes();
  if (!keyframes) return keyframes.error();
  Trajectory queried;
  for (const StoredKeyframe& keyframe : *keyframes)
    if (const auto found = reference.entries.find(keyframe.frame); found != reference.entries.end())
      queried.entries.insert(*found);
  return queried;
}

// A trajectory that `revisit slam` wrote, on the frames of the reference.
Result<JudgedTrajectory> judge(const fs::path& file, const Trajectory& reference) {
  const auto poses = read_poses(file);
  if (!poses) return poses.error();
  // By the times that the poses were written with, where the map has them.
  Stamps stamps;
  std::error_code failure;
  if (const fs::path map = MapStore::file_of(file.parent_path()); fs::exists(map, failure)) {
    const auto store = MapStore::open(map, MapStore::Access::kRead);
    if (!store) return store.error();
    const auto scans = store->scans();
    if (!scans) return scans.error();
    for (const StoredScan& scan : *scans)
      if (session_of(scan.frame) == 0) stamps.push_back({scan.frame, scan.stamp_s});
  } else {
    for (const auto& [frame, entry] : reference.entries) stamps.push_back({frame, entry.stamp_s});
  }
  JudgedTrajectory judged;
  judged.trajectory = to_trajectory(*poses, std::nullopt, stamps);
  judged.table = evaluate_trajectory(judged.trajectory, reference);
  return judged;
}

Status judge_trajectories(const fs::path& folder, const Trajectory& reference, EvaluationReport& report) {
  std::error_code failure;
  if (!fs::exists(folder / "odometry.tum", failure)) return ok();
  const auto before = judge(folder / "odometry.tum", reference), after = judge(folder / "poses.tum", reference);
  for (const auto* each : {&before, &after})
    if (!*each) return each->error();
  report.trajectories = {before->table, after->table};
  return draw_trajectories(folder / "trajectories.png", reference, *before, *after, folder / "map.ply");
}

// True poses of the map's key frames: a reference for each session, in the order in which they entered the map.
Result<std::map<FrameId, Pose>> true_keyframes(const EvaluateOptions& options, const std::string& map) {
  const auto store = MapStore::open(MapStore::file_of(map), MapStore::Access::kRead);
  if (!store) return store.error();
  const auto keyframes = store->keyframes();
  const auto sessions = store->sessions();
  if (!keyframes) return keyframes.error();
  if (!sessions) return sessions.error();
  std::vector<Trajectory> references;
  for (std::size_t i = 0; i < sessions->size(); ++i) {
    EvaluateOptions of_session = options;
    of_session.reference = i < options.map_references.size() ? options.map_references[i] : (*sessions)[i].recording;
    const auto recording = open_input((*sessions)[i].recording);
    auto reference = load_reference(of_session, recording ? recording->get() : nullptr);
    if (!reference) return reference.error();
    references.push_back(*std::move(reference));
  }
  std::map<FrameId, Pose> poses;
  for (const StoredKeyframe& each : *keyframes)
    if (const auto pose = references.at(static_cast<std::size_t>(session_of(each.frame))).at(in_recording(each.frame)))
      poses[each.frame] = *pose;
  if (poses.empty()) return Error{map + ": no key frame has a reference pose; name a reference with --map-reference"};
  return poses;
}

// What `revisit localise` wrote: table 5.
int evaluate_localisation(const EvaluateOptions& options) {
  const fs::path folder = options.results;
  const auto rows = read_localisation(folder / "localisation.csv");
  if (!rows) return fail(rows.error());
  const auto facts = read_run(folder / "run.json");
  if (!facts) return fail(facts.error());
  const auto recording =
      open_input(options.recording.empty() ? facts->input : options.recording, {.topic = facts->topic});
  const auto queries = load_reference(options, recording ? recording->get() : nullptr);
  if (!queries) return fail(queries.error());
  // Of a place that the map does not hold, no key frame is near.
  const auto keyframes = options.is_elsewhere ? Result<std::map<FrameId, Pose>>(std::map<FrameId, Pose>())
                                              : true_keyframes(options, facts->database);
  if (!keyframes) return fail(keyframes.error());
  const WakingTable table = evaluate_waking(*rows, *queries, *keyframes, {});
  std::cout << to_text(table, keyframes->size());
  if (const Status status = write_text(folder / "evaluation.json", to_json(table, keyframes->size())); !status)
    return fail(status.error());
  return kDone;
}

// A map itself: table 6.
int evaluate_map(const EvaluateOptions& options) {
  const auto truth = true_keyframes(options, options.results);
  if (!truth) return fail(truth.error());
  const auto map = SavedMap::open(options.results);
  if (!map) return fail(map.error());
  std::map<FrameId, MapKeyframe> keyframes;
  for (const auto& each : map->stored().keyframes)
    keyframes[each.frame.frame] = {map->T_map_lidar(each.frame.frame), map->part(each.frame.frame)};
  std::cout << to_text(evaluate_sessions(keyframes, *truth));
  return kDone;
}

int evaluate(const EvaluateOptions& options) {
  const fs::path folder = options.results;
  std::error_code failure;
  if (fs::is_regular_file(folder, failure) && is_map(folder)) return evaluate_map(options);
  if (options.reference.empty()) return fail({"--reference is missing: the true poses"}, kUsage);
  if (fs::exists(folder / "localisation.csv", failure)) return evaluate_localisation(options);
  const auto candidates = read_candidates(folder / "candidates.csv");
  if (!candidates) return fail(candidates.error());
  const auto loops = read_loops(folder / "loops.csv");
  if (!loops) return fail(loops.error());
  RunFacts facts;
  if (fs::exists(folder / "run.json", failure)) {
    const auto run = read_run(folder / "run.json");
    if (!run) return fail(run.error());
    facts = *run;
  }
  if (!facts.database.empty())
    return fail({options.results + ": was matched against another recording (" + facts.database +
                 "); only loops within one recording can be evaluated"});

  const std::string recording_folder = !options.recording.empty() ? options.recording : facts.input;
  std::unique_ptr<Recording> recording;
  if (!options.recording.empty() || fs::exists(recording_folder, failure)) {
    auto opened = open_input(recording_folder, {.topic = facts.topic});
    if (!opened) return fail(opened.error());
    recording = *std::move(opened);
  } else {
    print_log()(LogLevel::kWarning,
                "the recording '" + recording_folder +
                    "' is not there: every pose of the reference counts as a frame of it. Name it with --recording");
  }
  if (facts.interrupted)
    print_log()(LogLevel::kWarning,
                options.results + ": this run was interrupted; frames it did not reach count as missed");

  EvaluationReport report;
  report.results = options.results;
  report.reference = options.reference;
  // The same frames must be allowed here as were searched.
  report.rules.exclude_frames =
      options.exclude_frames.value_or(facts.exclude_frames.value_or(report.rules.exclude_frames));
  report.rules.exclude_s = options.exclude_s.value_or(facts.exclude_s.value_or(report.rules.exclude_s));
  if (report.rules.exclude_frames < 1 || !(report.rules.exclude_s >= 0.0))
    return fail({"matches excluded below " + std::to_string(report.rules.exclude_frames) + " frames and " +
                 std::to_string(report.rules.exclude_s) + " s; allowed: from 1 frame and from 0 s on"},
                kUsage);
  const auto trajectory = load_reference(options, recording.get());
  if (!trajectory) return fail(trajectory.error());
  const auto queried = queried_frames(folder, *trajectory);
  if (!queried) return fail(queried.error());
  const Reference reference(*queried, report.rules);
  report.retrieval = evaluate_retrieval(*candidates, reference);
  report.reverse_retrieval = evaluate_retrieval(*candidates, reference, RevisitKind::kReverse);
  report.loops = evaluate_loops(*loops, reference);

  if (const Status status = judge_trajectories(folder, *trajectory, report); !status) return fail(status.error());
  if (report.loops.without_reference > 0)
    print_log()(LogLevel::kWarning, std::to_string(report.loops.without_reference) +
                                        " accepted loops have no reference pose and are not judged");
  std::cout << to_text(report);
  for (const Status& status :
       {draw_precision_recall(folder / "precision_recall.png", report.retrieval, report.reverse_retrieval),
        draw_trajectory(folder / "trajectory.png", reference, report.loops),
        write_kitti_poses(folder / "reference.txt", *trajectory, std::nullopt),
        write_text(folder / "precision_recall.csv", curve_csv(report.retrieval)),
        write_text(folder / "evaluation.json", to_json(report)), write_text(folder / "report.html", to_html(report))})
    if (!status) return fail(status.error());
  std::cout << "Report: " << (folder / "report.html").string() << '\n';
  return kDone;
}

}  // namespace

Run add_evaluate(CLI::App& program) {
  auto options = std::make_shared<EvaluateOptions>();
  CLI::App* command = program.add_subcommand("evaluate", "Score results against reference poses, and draw them.");
  command->footer(
      "Prints table 1 (retrieval), table 2 (loop constraints) and, of `revisit slam`, table 3 (trajectory), or, of "
      "`revisit localise`,\ntable 5 (waking up in a map), of a map table 6 (sessions made one), and "
      "writes\n"
      "into DIR: report.html, precision_recall.png and .csv, trajectory.png, trajectories.png, evaluation.json, and "
      "reference.txt "
      "for `revisit view`. Works on the "
      "files of any program that writes\n"
      "candidates.csv and loops.csv (docs/formats.md).\n\n"
      "Example: revisit evaluate results/00 --reference kitti/poses/00.txt --camera-calibration "
      "kitti/sequences/00/calib.txt");
  command
      ->add_option("results", options->results,
                   "Folder that `revisit detect`, `slam` or `localise` wrote, or a map (NAME.revisit)")
      ->required();
  command->add_option("--reference", options->reference,
                      "Reference poses: a KITTI, TUM or g2o file, or a recording that has poses");
  command->add_option("--recording", options->recording, "The recording, where it is not where run.json says");
  command->add_option("--map-reference", options->map_references,
                      "Reference poses of the map that `revisit localise` used, one for each of its sessions, in the "
                      "same world (default: those of the recordings that it was made of)");
  command->add_flag(
      "--elsewhere", options->is_elsewhere,
      "The scans that `revisit localise` was given are of a place that the map does not hold: each answer "
      "is false");
  command->add_option("--camera-calibration", options->calibration,
                      "calib.txt with the row Tr, for poses of a KITTI camera (default: beside the poses)");
  command->add_option("--exclude-frames", options->exclude_frames,
                      "Frames a match must be older (default: as searched, else 50)");
  command->add_option("--exclude-s", options->exclude_s,
                      "Seconds a match must be older (default: as searched, else 30)");
  return [options] { return evaluate(*options); };
}

}  // namespace revisit::cli
