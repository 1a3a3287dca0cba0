// SPDX-License-Identifier: Apache-2.0
#include <fstream>
#include <iomanip>
#include <iostream>
#include <memory>
#include <optional>
#include <utility>

#include <revisit/io/pose_file.hpp>
#include <revisit/io/result_files.hpp>
#include <revisit/pipeline/loop_detector.hpp>

#include "common.hpp"
#include "progress.hpp"
#include "read_ahead.hpp"
#include "run_file.hpp"

namespace revisit::cli {
namespace {

struct DetectOptions {
  std::string input, out, database, calibration, poses;
  bool overwrite = false, evidence = false;
  ParameterFlags parameters;
};

void count(RunFile& run, const Detection& detection) {
  run.counts["queries_with_past"] += detection.newest_searchable.has_value();
  run.counts["loops"] += detection.loop.has_value();
  run.counts["registered"] += detection.geometric.has_value();
  run.counts["points"] += detection.points;
  run.counts["ground_points"] += detection.ground_points;
  const auto& ms = detection.preparation_ms;
  for (const auto& [stage, value] : {std::pair{"filter", ms.filter},
                                     {"ground", ms.ground},
                                     {"intensity", ms.intensity},
                                     {"describe", ms.describe},
                                     {"thin", ms.thin},
                                     {"search", detection.search_ms},
                                     {"temporal", detection.temporal_ms},
                                     {"geometric", detection.geometric_ms}})
    run.ms_total[stage] += value;
}

// evidence.csv: what spoke for and against every candidate that was registered.
class EvidenceFile {
 public:
  static constexpr const char* kHeader =
      "query,match,inlier_ratio,inlier_share,free_space_agreement,intensity_agreement,rmse_m,overlap,horizon,"
      "distance_m,log_odds,tx,ty,tz,qx,qy,qz,qw\n";
  explicit EvidenceFile(const std::filesystem::path& file) : file_(file.string()), stream_(file) {
    stream_ << kHeader << std::setprecision(10);
  }
  Status add(const Detection& detection) {
    for (const Detection::Registered& each : detection.registered) {
      const LoopEvidence& e = each.evidence.evidence;
      const Eigen::Vector3d t = each.evidence.T_match_query.translation();
      const Eigen::Quaterniond q(each.evidence.T_match_query.rotation());
      stream_ << detection.frame.value << ',' << each.match.value << ',' << e.inlier_ratio << ',' << e.inlier_share
              << ',' << e.free_space_agreement << ',';
      if (e.intensity_agreement) stream_ << *e.intensity_agreement;
      for (const double value : {e.rmse_m, e.overlap, e.horizon, e.distance_m, each.evidence.log_odds, t.x(), t.y(),
                                 t.z(), q.x(), q.y(), q.z(), q.w()})
        stream_ << ',' << value;
      stream_ << '\n';
    }
    return stream_ ? ok() : Status(Error{file_ + ": cannot be written"});
  }

 private:
  std::string file_;
  std::ofstream stream_;
};

// Scans that cannot be used are told, counted and left out; the rest goes on.
void skip(RunFile& run, Progress& progress, const Error& error) {
  progress.clear();
  print_log()(LogLevel::kWarning, error.message + "; skipped");
  run.skipped.push_back(error.message);
}

Status write_loop(ResultWriter& writer, const Detection& detection) {
  if (detection.newest_searchable)
    if (const Status status = writer.add(detection.row()); !status) return status;
  return detection.loop ? writer.add(LoopRow{*detection.loop, detection.score}) : ok();
}

// The places of another recording, to be found again.
Status learn_database(LoopDetector& detector, const Recording& database, RunFile& run) {
  Progress progress("learn", "scans", database.size());
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

Status detect_all(LoopDetector& detector, const Recording& recording, ResultWriter& writer,
                  std::optional<EvidenceFile>& evidence, RunFile& run) {
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
    auto detection = !scan ? Result<Detection>(scan.error())
                     : run.database.empty()
                         ? detector.process(*std::move(scan), recording.trajectory().at(recording.frame(i)))
                         : detector.localise(*std::move(scan));
    if (!detection) {
      skip(run, progress, detection.error());
    } else {
      ++run.counts["scans"];
      count(run, *detection);
      if (const Status status = write_loop(writer, *detection); !status) return status;
      if (evidence)
        if (const Status status = evidence->add(*detection); !status) return status;
    }
    progress.update(i + 1);
  }
  run.interrupted = interrupted();
  return ok();
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
  const auto recording = open_input(options.input, options.poses, &*parameters);
  if (!recording) return fail(recording.error());
  Result<std::unique_ptr<Recording>> database = std::unique_ptr<Recording>();
  if (!options.database.empty()) database = open_input(options.database);
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
  run.parameters = *parameters;
  const Recording& scale_source = *database ? **database : **recording;
  const auto scale = estimate_intensity_scale(scale_source, *parameters);
  if (!scale) return fail({scale.error().message + "; no scan can be used"});
  run.intensity = *scale;
  if (!scale->warning.empty())
    print_log()(LogLevel::kWarning, (*database ? options.database : options.input) + ": " + scale->warning);

  auto writer = ResultWriter::create(options.out, options.overwrite);
  if (!writer) return fail(writer.error());
  const std::filesystem::path out = options.out;
  if (const Status status = write_poses(out, **recording); !status) return fail(status.error());

  listen_for_interrupt();
  LoopDetector detector(*parameters, *scale, *calibration, print_log());
  if (*database)
    if (const Status status = learn_database(detector, **database, run); !status) return fail(status.error());
  std::optional<EvidenceFile> evidence;
  if (options.evidence) evidence.emplace(out / "evidence.csv");
  Status status = detect_all(detector, **recording, *writer, evidence, run);
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
      "  candidates.csv  one row a scan that had a searchable past: what it looked like, and why it was refused\n"
      "  loops.csv       one row an accepted loop, with its 6-DoF pose T_match_query\n"
      "  poses.txt/.tum  the poses that came with the recording, if any, and the calib.txt that poses.txt needs\n"
      "  run.json        version, parameters, counts, milliseconds a stage\n\n"
      "Example: revisit detect kitti/sequences/00 --out results/00");
  command
      ->add_option("input", options->input,
                   "Recording: KITTI folder, KITTI raw drive, folder of scans, or .toml of a simulated drive")
      ->required();
  command->add_option("--out", options->out, "Folder for the results")->required();
  command->add_option("--database", options->database,
                      "Look for the scans of the recording in this other one (a map) instead of in its own past");
  command->add_option("--poses", options->poses,
                      "Pose file (KITTI, TUM, g2o), instead of the recording's own poses; never used to find loops");
  command->add_option("--calibration", options->calibration, "Intensity calibration made by `revisit calibrate`");
  command->add_flag("--overwrite", options->overwrite, "Replace results that are already in the folder");
  command->add_flag("--evidence", options->evidence,
                    "Write evidence.csv too: what spoke for and against every candidate that was registered");
  options->parameters.add_to(*command);
  return [options] { return detect(*options); };
}

}  // namespace revisit::cli
