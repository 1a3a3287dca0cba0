// SPDX-License-Identifier: Apache-2.0
#include <fstream>
#include <functional>
#include <iomanip>
#include <iostream>
#include <memory>
#include <optional>
#include <utility>

#include <revisit/core/stopwatch.hpp>
#include <revisit/io/pose_file.hpp>
#include <revisit/io/result_files.hpp>
#include <revisit/pipeline/localiser.hpp>
#include <revisit/pipeline/loop_detector.hpp>
#include <revisit/pipeline/recording_scale.hpp>
#include <revisit/store/stored_clouds.hpp>

#include "common.hpp"
#include "progress.hpp"
#include "read_ahead.hpp"
#include "reports/evidence_file.hpp"
#include "reports/run_file.hpp"

namespace revisit::cli {
namespace {

struct DetectOptions {
  std::string input, out, database, calibration, poses;
  bool overwrite = false;
  InputFlags recording;
  ParameterFlags parameters;
};

void count(RunFile& run, const Detection& detection) {
  run.counts["queries_with_past"] += detection.searchable_places > 0;
  run.counts["loops"] += detection.loops().size();
  run.counts["loops_found_later"] += detection.earlier.size();
  run.counts["registered"] += detection.geometric.has_value();
  run.counts["points"] += detection.points;
  run.counts["ground_points"] += detection.ground_points;
  const auto& ms = detection.preparation_ms;
  for (const auto& [stage, value] : {std::pair{"filter", ms.filter},
                                     {"ground", ms.ground},
                                     {"intensity", ms.intensity},
                                     {"describe", ms.describe},
                                     {"thin", ms.thin},
                                     {"odometry", detection.odometry_ms},
                                     {"search", detection.search_ms},
                                     {"temporal", detection.temporal_ms},
                                     {"geometric", detection.geometric_ms}})
    run.ms_total[stage] += value;
}

// Scans that cannot be used are named, counted and left out; the rest goes on.
void skip(RunFile& run, Progress& progress, const Error& error) {
  progress.clear();
  print_log()(LogLevel::kWarning, error.message + "; skipped");
  run.skipped.push_back(error.message);
}

Status write_loops(ResultWriter& writer, const Detection& detection) {
  if (detection.searchable_places > 0)
    if (const Status status = writer.add(detection.row()); !status) return status;
  for (const LoopConstraint& loop : detection.loops())
    if (const Status status = writer.add(loop); !status) return status;
  for (const Detection& each : detection.earlier) writer.replace(each.row());
  return ok();
}

// The places of another recording.
Status add_database(LoopDetector& detector, const Recording& database, RunFile& run) {
  Progress progress("database", "scans", database.size());
  ReadAhead scans(database);
  for (std::size_t i = 0; i < database.size() && !interrupted(); ++i) {
    auto scan = scans.next();
    const Status status =
        scan ? detector.add(*std::move(scan), database.trajectory().at(database.frame(i))) : scan.error();
    if (!status) skip(run, progress, status.error());
    progress.update(i + 1);
  }
  if (detector.index().size() == 0) return Error{run.database + ": no scan of the database can be used"};
  run.counts["database_places"] = detector.index().size();
  return ok();
}

// What becomes of the scan that comes as number i.
using DetectOne = std::function<Result<Detection>(Scan scan, std::size_t i)>;

Status detect_all(const Recording& recording, const DetectOne& detect_one, ResultWriter& writer, EvidenceFile& evidence,
                  RunFile& run) {
  Progress progress("detect", "scans", recording.size());
  ReadAhead scans(recording);
  for (std::size_t i = 0; i < recording.size() && !interrupted(); ++i) {
    Stopwatch watch;
    auto scan = scans.next();
    run.ms_total["read"] += watch.lap_ms();
    if (scan) {
      run.counts["dropped_non_finite"] += scan->dropped_non_finite;
      run.counts["dropped_at_origin"] += scan->dropped_at_origin;
    }
    auto detection = scan ? detect_one(*std::move(scan), i) : Result<Detection>(scan.error());
    if (!detection) {
      skip(run, progress, detection.error());
    } else {
      ++run.counts["scans"];
      count(run, *detection);
      if (const Status status = write_loops(writer, *detection); !status) return status;
      if (const Status status = evidence.add(*detection); !status) return status;
      for (const Detection& each : detection->earlier)
        if (const Status status = evidence.add(each); !status) return status;
    }
    run.memory.after(i);
    progress.update(i + 1);
  }
  run.interrupted = interrupted();
  return ok();
}

// Where the scans are looked for: in the recording's own past, another recording, or a map.
struct Database {
  std::unique_ptr<Recording> recording;
  std::optional<Localiser> map;
};

Result<Database> open_database(const std::string& path, const Parameters& parameters) {
  Database database;
  if (path.empty()) return database;
  const std::filesystem::path file = path;
  if (is_map(file)) {
    auto map = Localiser::open(file, parameters, print_log());
    if (!map) return map.error();
    database.map = *std::move(map);
    return database;
  }
  auto recording = open_input(path);
  if (!recording) return recording.error();
  database.recording = *std::move(recording);
  return database;
}

Status write_poses(const std::filesystem::path& folder, const Recording& recording) {
  if (recording.trajectory().empty()) return ok();
  // poses.txt is in the camera's frame where there is one, and means nothing without its calibration.
  if (const auto T_camera_lidar = recording.T_camera_lidar())
    if (const Status status = write_camera_calibration(folder / "calib.txt", *T_camera_lidar); !status) return status;
  if (const Status status = write_kitti_poses(folder / "poses.txt", recording.trajectory(), recording.T_camera_lidar());
      !status)
    return status;
  return write_tum_poses(folder / "poses.tum", recording.trajectory());
}

int detect(const DetectOptions& options) {
  auto parameters = options.parameters.resolve();
  if (!parameters) return fail(parameters.error(), kUsage);
  const auto calibration = load_calibration(options.calibration);
  if (!calibration) return fail(calibration.error());
  const auto recording = open_input(options.input, options.recording.options(options.poses), &*parameters);
  if (!recording) return fail(recording.error());
  use_frames_alone_without_times(**recording, *parameters);
  auto database = open_database(options.database, *parameters);
  if (!database) return fail(database.error());

  RunFile run;
  run.command = "detect";
  // Absolute, so that `evaluate` finds them from any folder.
  const auto absolute = [](const std::string& path) {
    return path.empty() ? path : std::filesystem::absolute(path).lexically_normal().string();
  };
  run.arguments = program_arguments();
  run.input = absolute(options.input);
  run.database = absolute(options.database);
  run.poses = absolute(options.poses);
  run.calibration = absolute(options.calibration);
  run.topic = options.recording.options().topic;
  run.parameters = *parameters;
  const Recording& scale_source = database->recording ? *database->recording : **recording;
  const auto scale = intensity_scale_of(scale_source, parameters->intensity);
  if (!scale) return fail({scale.error().message + "; no scan can be used"});
  run.intensity = *scale;
  if (!scale->warning.empty())
    print_log()(LogLevel::kWarning, (database->recording ? options.database : options.input) + ": " + scale->warning);

  auto writer = ResultWriter::create(
      options.out, options.overwrite ? ResultWriter::Existing::kReplace : ResultWriter::Existing::kRefuse);
  if (!writer) return fail(writer.error());
  const std::filesystem::path out = options.out;
  if (const Status status = write_poses(out, **recording); !status) return fail(status.error());

  listen_for_interrupt();
  LoopDetector detector(*parameters, *scale, *calibration, print_log(), clouds_in_file());
  if (database->recording)
    if (const Status status = add_database(detector, *database->recording, run); !status) return fail(status.error());
  if (database->map) run.counts["database_places"] = database->map->places();
  EvidenceFile evidence(std::filesystem::path(out) / "evidence.csv");
  const DetectOne detect_one = [&](Scan scan, std::size_t i) -> Result<Detection> {
    if (database->recording) return detector.localise(std::move(scan));
    if (!database->map) return detector.process(std::move(scan), (*recording)->trajectory().at((*recording)->frame(i)));
    auto found = database->map->locate(std::move(scan));
    if (!found) return found.error();
    return std::move(found->detection);
  };
  Status status = detect_all(**recording, detect_one, *writer, evidence, run);
  run.counts["skipped"] = run.skipped.size();
  // run.json comes last and says how far the run came, whatever happened.
  const Status finished = writer->finish();
  const Status described = write_run(out / "run.json", run);
  for (const Status* each : {&std::as_const(status), &finished, &described})
    if (!*each) return fail(each->error());

  if (run.interrupted) print_log()(LogLevel::kWarning, "interrupted: the results hold what was computed until now");
  if (run.counts["queries_with_past"] == 0 && run.counts["scans"] > 0)
    print_log()(LogLevel::kWarning,
                "no scan had a searchable past: places fewer than " +
                    std::to_string(parameters->retrieval.exclude_frames) + " frames or " +
                    get_parameter(*parameters, "retrieval.exclude_s") +
                    " s before it are not searched (--retrieval.exclude_frames, --retrieval.exclude_s)");
  std::cout << run.counts["scans"] << " scans, " << run.counts["loops"] << " loops, " << run.skipped.size()
            << " scans skipped: " << options.out << "/loops.csv\n";
  if (run.interrupted) return kInterrupted;
  if (run.counts["scans"] == 0) return fail({options.input + ": no scan can be used"});
  return run.skipped.empty() && scale->is_reflectance ? kDone : kDoneWithReservations;
}

}  // namespace

Run add_detect(CLI::App& program) {
  auto options = std::make_shared<DetectOptions>();
  CLI::App* command = program.add_subcommand("detect", "Find the loop closures of a recording.");
  command->footer(
      "Writes into the folder of --out (formats: docs/formats.md):\n"
      "  candidates.csv  one row a scan that had a searchable past: the best candidate, and why it was refused\n"
      "  loops.csv       one row an accepted loop, with its 6-DoF pose T_match_query\n"
      "  poses.txt/.tum  the poses that came with the recording, if any, and the calib.txt that poses.txt needs\n"
      "  run.json        version, parameters, counts, milliseconds a stage\n\n"
      "Example: revisit detect kitti/sequences/00 --out results/00");
  command->add_option("input", options->input, kRecordingHelp)->required();
  command->add_option("--out", options->out, "Folder for the results")->required();
  command->add_option(
      "--database", options->database,
      "Look for the scans in this map of `revisit slam`, or in this other recording, instead of in their own past");
  command->add_option("--poses", options->poses,
                      "Pose file (KITTI, TUM, g2o), instead of the recording's own poses; never used to find loops");
  command->add_option("--calibration", options->calibration, "Intensity calibration made by `revisit calibrate`");
  command->add_flag("--overwrite", options->overwrite, "Replace results that are already in the folder");
  options->recording.add_to(*command);
  options->parameters.add_to(*command);
  return [options] { return detect(*options); };
}

}  // namespace revisit::cli
