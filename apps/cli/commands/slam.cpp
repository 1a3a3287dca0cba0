// SPDX-License-Identifier: Apache-2.0
#include <chrono>
#include <iostream>
#include <memory>
#include <thread>
#include <utility>
#include <vector>

#include <revisit/core/stopwatch.hpp>
#include <revisit/pipeline/recording_scale.hpp>
#include <revisit/preprocess/undistort.hpp>

#include "commands/slam_inputs.hpp"
#include "commands/slam_results.hpp"
#include "progress.hpp"
#include "read_ahead.hpp"
#include "reports/evidence_file.hpp"
#include "reports/run_file.hpp"
#include "view/view_server.hpp"

namespace revisit::cli {
namespace {

namespace fs = std::filesystem;

Status run_all(Slam& slam, const Recording& recording, const OtherOdometry& odometry, double sweep_s,
               std::vector<EvidenceFile>& evidence, RunFile& run) {
  std::size_t first = 0;
  if (const auto last = slam.last_frame()) {
    while (first < recording.size() && recording.frame(first) <= *last) ++first;
    print_log()(LogLevel::kInfo, "going on after frame " + std::to_string(last->value) + ": " +
                                     std::to_string(slam.graph().keyframes().size()) + " key frames are there");
  }
  Progress progress("slam", "scans", recording.size() - first);
  ReadAhead scans(recording, first);
  for (std::size_t i = first; i < recording.size() && !interrupted(); ++i) {
    Stopwatch watch;
    auto scan = scans.next();
    run.ms_total["read"] += watch.lap_ms();
    if (scan) assume_sweep(*scan, sweep_s);
    const auto step = scan ? slam.process(*std::move(scan), odometry(i)) : Result<SlamStep>(scan.error());
    if (step) {
      count(run, *step);
      for (EvidenceFile& file : evidence)
        if (const Status status = step->detection ? file.add(*step->detection) : ok(); !status) return status;
    } else if (slam.has_failed()) {
      return step.error();
    } else {
      progress.clear();
      print_log()(LogLevel::kWarning, step.error().message + "; skipped");
      run.skipped.push_back(step.error().message);
    }
    run.memory.after(i);
    progress.update(i + 1 - first);
  }
  run.interrupted = interrupted();
  return slam.finish();
}

// The map as it grows, in a browser, until the program ends.
Result<std::unique_ptr<ViewServer>> look_at(const fs::path& out) {
  auto view = ResultsView::open(out);
  if (!view) return view.error();
  auto server = ViewServer::start({*std::move(view)}, {});
  if (server) print_log()(LogLevel::kInfo, "look at it while it grows: " + (*server)->address());
  return server;
}

RunFile describe_run(const SlamOptions& options, const Parameters& parameters, const IntensityScale& scale) {
  RunFile run;
  run.command = "slam";
  run.arguments = program_arguments();
  run.input = fs::absolute(options.input).lexically_normal().string();
  run.poses = options.odometry.empty() ? options.wheels : options.odometry;
  run.calibration = options.calibration;
  run.topic = options.recording.options().topic;
  run.parameters = parameters;
  run.intensity = scale;
  return run;
}

// In the results, and beside the map that is added to.
std::vector<EvidenceFile> evidence_files(const SlamOptions& options, const Slam& slam) {
  const auto last = slam.last_frame();
  std::vector<EvidenceFile> files;
  files.emplace_back(fs::path(options.out) / "evidence.csv", last);
  if (!options.into.empty()) {
    const FrameId before{in_map(slam.session(), last.value_or(FrameId{0})).value - (last ? 0 : 1)};
    files.push_back(EvidenceFile::of_map(MapStore::file_of(options.into), before));
  }
  return files;
}

// What was found is written, whatever happened.
Status write_results(const Slam& slam, const Recording& recording, const MapStore& store, ResultWriter& writer,
                     bool with_map, const fs::path& out, RunFile& run) {
  const Status rows = write_rows(store, slam.session(), writer);
  const Status poses = !slam.has_keyframes() ? ok() : write_trajectories(slam, recording, out);
  const Status map = !slam.has_keyframes() || !with_map ? ok() : write_map(slam, out, run);
  const Status described = write_run(out / "run.json", run);
  for (const Status* each : {&rows, &poses, &map, &described})
    if (!*each) return *each;
  return ok();
}

int slam(const SlamOptions& options) {
  auto parameters = options.parameters.resolve();
  if (!parameters) return fail(parameters.error(), kUsage);
  if (!options.odometry.empty() && !options.wheels.empty())
    return fail({"--odometry and --wheels: the first is taken instead of tracking, the second helps it; name one"},
                kUsage);
  const auto calibration = load_calibration(options.calibration);
  if (!calibration) return fail(calibration.error());
  const auto recording = open_input(options.input, options.recording.options(options.poses), &*parameters);
  if (!recording) return fail(recording.error());
  use_frames_alone_without_times(**recording, *parameters);
  const auto odometry = other_odometry(options, **recording);
  if (!odometry) return fail(odometry.error());
  const auto scale = intensity_scale_of(**recording, parameters->intensity);
  if (!scale) return fail({scale.error().message + "; no scan can be used"});
  auto gps = gps_fixes(options, **recording);
  if (!gps) return fail(gps.error());
  if (!scale->warning.empty()) print_log()(LogLevel::kWarning, options.input + ": " + scale->warning);

  RunFile run = describe_run(options, *parameters, *scale);
  const auto store = open_store(options);
  if (!store) return fail(store.error());
  const auto setup = slam_setup(options, *parameters, *scale, *calibration, *std::move(gps), run.input, **store);
  if (!setup) return fail(setup.error());
  auto slam = Slam::open(*store, *parameters, *setup);
  if (!slam) return fail(slam.error());

  const fs::path out = options.out;
  auto writer =
      ResultWriter::create(out, ResultWriter::Existing::kReplace);  // whether there was a map is decided above
  if (!writer) return fail(writer.error());
  if (std::error_code failure; !options.resume && fs::exists(out / "tiles" / "tileset.json", failure))
    fs::remove_all(out / "tiles", failure);  // of another map
  std::vector<EvidenceFile> evidence = evidence_files(options, *slam);
  const auto viewer = options.is_viewed ? look_at(options.into.empty() ? out : fs::path(options.into))
                                        : Result<std::unique_ptr<ViewServer>>(nullptr);
  if (!viewer) return fail(viewer.error());
  listen_for_interrupt();
  Stopwatch watch;
  const Status status = run_all(*slam, **recording, *odometry, options.sweep_s, evidence, run);
  run.ms_total["all"] = watch.lap_ms();
  run.counts["skipped"] = run.skipped.size();
  const Status written = write_results(*slam, **recording, **store, *writer, !options.without_map, out, run);
  if (!status) return fail(status.error());
  if (!written) return fail(written.error());

  if (!slam->has_keyframes()) return fail({options.input + ": no scan can be used"});
  tell_result(*slam, run, out, !options.without_map);
  if (run.interrupted) return kInterrupted;
  if (*viewer) {
    std::cout << "Look at it: " << (*viewer)->address() << "   Ctrl-C ends." << std::endl;
    while (!interrupted()) std::this_thread::sleep_for(std::chrono::milliseconds(100));
  }
  return run.skipped.empty() && run.untracked.empty() ? kDone : kDoneWithReservations;
}

}  // namespace

Run add_slam(CLI::App& program) {
  auto options = std::make_shared<SlamOptions>();
  CLI::App* command = program.add_subcommand("slam", "Turn a recording into a corrected trajectory and a map.");
  command->footer(
      "Scans are tracked against what was seen lately, loops correct the drift. Writes into the folder of --out\n"
      "(formats: docs/formats.md):\n"
      "  poses.txt/.tum   the corrected trajectory\n"
      "  odometry.tum     the trajectory before any loop\n"
      "  map.ply/.pcd/.las  the map, without what moved; map.png shows it, tiles/ holds it for viewers (3D Tiles)\n"
      "  graph.g2o        the pose graph\n"
      "  loops.csv, candidates.csv, evidence.csv, run.json   as `revisit detect` writes them, for key frames\n"
      "  map.revisit      everything as it is found: an interrupted run continues with --resume (docs/maps.md)\n\n"
      "Example: revisit slam kitti/sequences/00 --out maps/00\n"
      "         revisit evaluate maps/00 --reference kitti/poses/00.txt");
  command->add_option("input", options->input, "Recording, as for `revisit detect`")->required();
  command->add_option("--out", options->out, "Folder for the results")->required();
  command->add_option(
      "--wheels", options->wheels,
      "Pose file (TUM, KITTI, g2o) of wheel odometry, in the LiDAR's frame, that helps where scans fail "
      "(default: the recording's own, if any: wheel_odometry.tum, a bag's odometry; none: without)");
  command->add_option("--odometry", options->odometry,
                      "Pose file of another odometry, taken instead of tracking the scans (wheels: the recording's)");
  command
      ->add_option(
          "--sweep", options->sweep_s,
          "For points without times whose distortion nobody has undone (KITTI raw): the sensor turns once in so "
          "many seconds, clockwise from above, and looks ahead at the stamp; negative: the other way round")
      ->check(CLI::Range(-1.0, 1.0));
  command->add_option(
      "--into", options->into,
      "A map of before (file, or folder of --out) that this recording is added to: it is found in it by "
      "its loops, wherever it starts");
  command
      ->add_option("--gps", options->gps,
                   "Places the map on the earth, and keeps it there: by the recording's GPS (sensor_msgs/NavSatFix; "
                   "with a name, that topic), or by an NMEA log")
      ->expected(0, 1);
  command->add_option("--poses", options->poses,
                      "Reference poses (KITTI, TUM, g2o), written into the results for `revisit evaluate`; never used "
                      "to track or to find loops");
  command->add_option("--calibration", options->calibration, "Intensity calibration made by `revisit calibrate`");
  command->add_flag("--resume", options->resume,
                    "Go on with the map in the folder as if the run that made it had not been killed");
  command->add_option("--checkpoint-s", options->checkpoint_s, "Seconds of work that a kill may cost, about")
      ->check(CLI::Range(0.0, 3600.0))
      ->capture_default_str();
  command->add_flag("--overwrite", options->overwrite, "Replace the map that is in the folder");
  command->add_flag("--no-map", options->without_map, "Write the trajectory only");
  command->add_flag("--view", options->is_viewed, "Show the map in a browser while it grows (an address is printed)");
  options->recording.add_to(*command);
  options->parameters.add_to(*command);
  return [options] { return slam(*options); };
}

}  // namespace revisit::cli
