// SPDX-License-Identifier: Apache-2.0
#include <chrono>
#include <iostream>
#include <memory>
#include <optional>
#include <thread>
#include <tuple>
#include <vector>

#include <revisit/core/stopwatch.hpp>
#include <revisit/core/text.hpp>
#include <revisit/io/nmea_file.hpp>
#include <revisit/io/pose_file.hpp>
#include <revisit/io/result_files.hpp>
#include <revisit/pipeline/recording_scale.hpp>
#include <revisit/pipeline/slam.hpp>
#include <revisit/preprocess/undistort.hpp>

#include "common.hpp"
#include "pictures/map_picture.hpp"
#include "progress.hpp"
#include "read_ahead.hpp"
#include "reports/evidence_file.hpp"
#include "reports/run_file.hpp"
#include "view/view_server.hpp"

namespace revisit::cli {
namespace {

namespace fs = std::filesystem;

struct SlamOptions {
  std::string input, out, into, poses, calibration, odometry, wheels;
  std::optional<std::string> gps;
  double sweep_s = 0.0;
  bool overwrite = false, resume = false, without_map = false, is_viewed = false;
  double checkpoint_s = SlamSetup().checkpoint_every_s;
  InputFlags recording;
  ParameterFlags parameters;
};

// The pose that stands in for, or helps, the tracking of scan `index`, if there is one.
using OtherOdometry = std::function<std::optional<Pose>(std::size_t index)>;

Result<OtherOdometry> other_odometry(const SlamOptions& options, const Recording& recording) {
  const std::string& file = options.odometry.empty() ? options.wheels : options.odometry;
  if (file == "none") return OtherOdometry([](std::size_t) { return std::nullopt; });
  if (file == "wheels" && !recording.has_wheel_odometry()) return Error{options.input + ": has no wheel odometry"};
  if (file.empty() || file == "wheels")
    return OtherOdometry([&recording](std::size_t index) { return recording.wheel_pose(index); });
  const auto poses = read_poses(file);
  if (!poses) return poses.error();
  auto trajectory = to_trajectory(*poses, recording.T_camera_lidar(), stamps_of(recording));
  if (trajectory.empty()) return Error{file + ": no pose belongs to a frame of the recording"};
  return OtherOdometry([&recording, poses_of = std::move(trajectory)](std::size_t index) {
    return poses_of.at(recording.frame(index));
  });
}

// Of an NMEA log, or of the recording's own receiver.
Result<std::vector<GpsFix>> gps_fixes(const SlamOptions& options, const Recording& recording) {
  if (!options.gps) return std::vector<GpsFix>();
  std::error_code failure;
  const bool is_file = fs::is_regular_file(*options.gps, failure);
  auto fixes = is_file ? read_nmea(*options.gps) : recording.gps_fixes(*options.gps);
  if (!fixes) return fixes.error();
  const std::string what = is_file ? *options.gps : options.input;
  if (fixes->empty()) return Error{what + ": holds no GPS fix; name an NMEA log, or a topic of NavSatFix"};
  const double first_s = recording.stamp_s(0), last_s = recording.stamp_s(recording.size() - 1);
  if (fixes->back().stamp_s < first_s || fixes->front().stamp_s > last_s)
    return Error{what +
                 format(": its fixes are of %.1f to %.1f s, the scans of %.1f to %.1f s", fixes->front().stamp_s,
                        fixes->back().stamp_s, first_s, last_s) +
                 ": one of the clocks must be set to the other"};
  return fixes;
}

// Of --into: a session that was killed before its first checkpoint left nothing to go on with.
Result<bool> begins_session(const MapStore& store, const SlamOptions& options, const std::string& recording) {
  if (options.into.empty() || !options.resume) return !options.into.empty();
  const auto sessions = store.sessions();
  if (!sessions) return sessions.error();
  return sessions->empty() || sessions->back().recording != recording;
}

// A session is not continued with another recording.
Status check_session(const MapStore& store, const std::string& recording, const std::string& parameters) {
  const auto sessions = store.sessions();
  if (!sessions) return sessions.error();
  if (sessions->empty()) return ok();
  const StoredSession& last = sessions->back();
  for (const auto& [what, was, is] :
       {std::tuple{"the recording", &last.recording, &recording}, {"the parameters", &last.parameters, &parameters}})
    if (*was != *is) return Error{store.file() + ": was made with " + what + " '" + *was + "', not '" + *is + "'"};
  return ok();
}

// What must stay as it was when the map was begun.
std::string parameters_text(const Parameters& parameters, const SlamOptions& options) {
  std::string text = "odometry=" + options.odometry + " wheels=" + options.wheels +
                     " calibration=" + options.calibration + " sweep=" + std::to_string(options.sweep_s) +
                     options.recording.text();
  for (const ParameterInfo& info : parameter_infos())
    if (info.name.starts_with("preprocess.") || info.name.starts_with("intensity.") ||
        info.name.starts_with("descriptor."))
      text += " " + info.name + "=" + get_parameter(parameters, info.name);
  return text;
}

Result<std::shared_ptr<MapStore>> shared(Result<MapStore> store) {
  if (!store) return store.error();
  return std::make_shared<MapStore>(*std::move(store));
}

Result<std::shared_ptr<MapStore>> open_store(const SlamOptions& options) {
  std::error_code failure;
  fs::create_directories(options.out, failure);
  if (failure) return Error{options.out + ": cannot be created: " + failure.message()};
  if (!options.into.empty()) {
    const fs::path map = MapStore::file_of(options.into);
    if (!fs::exists(map, failure))
      return Error{map.string() + ": no such map; `revisit slam` without --into makes one"};
    return shared(MapStore::open(map));
  }
  const fs::path file = MapStore::file_of(options.out);
  const bool exists = fs::exists(file, failure);
  if (exists && options.overwrite && !options.resume) {
    if (const Status removed = MapStore::remove_file(file); !removed) return removed.error();
  } else if (exists && !options.resume) {
    return Error{options.out +
                 ": already holds a map; continue it with --resume, replace it with --overwrite, or name another "
                 "folder"};
  }
  return shared(fs::exists(file, failure) ? MapStore::open(file)
                                          : MapStore::create(fs::path(options.out) / MapStore::kFileName));
}

void count(RunFile& run, const SlamStep& step) {
  ++run.counts["scans"];
  run.counts["keyframes"] += step.is_keyframe;
  run.counts["untracked"] += !step.is_tracked;
  run.counts["segments_begun"] += step.starts_segment;
  if (!step.is_tracked) run.untracked.push_back(step.frame.value);
  run.counts["loops"] += step.loops_entered;
  for (const auto& [stage, value] : {std::pair{"odometry", step.ms.odometry},
                                     {"prepare", step.ms.prepare},
                                     {"detect", step.ms.detect},
                                     {"graph", step.ms.graph},
                                     {"store", step.ms.store}})
    run.ms_total[stage] += value;
}

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

// "3 to 7, 12": the first few runs of consecutive frames.
std::string to_ranges(const std::vector<std::int64_t>& frames) {
  constexpr int kMost = 8;
  std::string text;
  int ranges = 0;
  for (std::size_t begin = 0, end = 0; begin < frames.size(); begin = end) {
    for (end = begin + 1; end < frames.size() && frames[end] == frames[end - 1] + 1;) ++end;
    if (++ranges > kMost) return text + ", ...";
    text += (text.empty() ? "" : ", ") + std::to_string(frames[begin]);
    if (end - begin > 1) text += " to " + std::to_string(frames[end - 1]);
  }
  return text;
}

// Within this session, by the frames of its recording.
Status write_rows(const MapStore& store, int session, ResultWriter& writer) {
  const auto answers = store.answers();
  const auto edges = store.edges();
  if (!answers) return answers.error();
  if (!edges) return edges.error();
  const auto is_own = [session](FrameId frame) { return session_of(frame) == session; };
  for (CandidateRow row : *answers) {
    if (!is_own(row.query) || (row.match && !is_own(*row.match))) continue;
    row.query = in_recording(row.query);
    if (row.match) row.match = in_recording(*row.match);
    if (const Status status = writer.add(row); !status) return status;
  }
  for (const StoredEdge& edge : *edges) {
    if (!edge.loop || !is_own(edge.from) || !is_own(edge.to)) continue;
    LoopConstraint loop = *edge.loop;
    loop.query = in_recording(loop.query);
    loop.match = in_recording(loop.match);
    if (const Status status = writer.add(loop); !status) return status;
  }
  return writer.finish();
}

Status write_trajectories(const Slam& slam, const Recording& recording, const fs::path& out) {
  const auto trajectories = slam.trajectories();
  if (!trajectories) return trajectories.error();
  const auto T_camera_lidar = recording.T_camera_lidar();
  if (T_camera_lidar)
    if (const Status status = write_camera_calibration(out / "calib.txt", *T_camera_lidar); !status) return status;
  for (const Status& status : {write_kitti_poses(out / "poses.txt", trajectories->corrected, T_camera_lidar),
                               write_tum_poses(out / "poses.tum", trajectories->corrected),
                               write_tum_poses(out / "odometry.tum", trajectories->odometry),
                               slam.graph().graph().write_g2o(out / "graph.g2o")})
    if (!status) return status;
  return ok();
}

Status write_map(const Slam& slam, const fs::path& out, RunFile& run) {
  Stopwatch watch;
  Progress progress("map", "key frames", slam.graph().keyframes().size());
  const auto report = slam.write_map(out, [&](std::size_t done) {
    progress.update(done);
    return true;
  });
  if (!report) return report.error();
  run.counts["map_points"] = report->points;
  run.counts["moving_points_left_out"] = report->moving;
  run.ms_total["map"] = watch.lap_ms();
  return draw_map(out / "map.png", out / "map.ply", slam.graph().graph().nodes());
}

// The map as it grows, in a browser, until the program ends.
Result<std::unique_ptr<ViewServer>> look_at(const fs::path& out) {
  auto view = ResultsView::open(out);
  if (!view) return view.error();
  auto server = ViewServer::start({*std::move(view)}, {});
  if (server) print_log()(LogLevel::kInfo, "look at it while it grows: " + (*server)->address());
  return server;
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

  RunFile run;
  run.command = "slam";
  run.arguments = program_arguments();
  run.input = fs::absolute(options.input).lexically_normal().string();
  run.poses = options.odometry.empty() ? options.wheels : options.odometry;
  run.calibration = options.calibration;
  run.topic = options.recording.options().topic;
  run.parameters = *parameters;
  run.intensity = *scale;

  const auto store = open_store(options);
  if (!store) return fail(store.error());
  const auto is_new = begins_session(**store, options, run.input);
  if (!is_new) return fail(is_new.error());
  SlamSetup setup{*scale,
                  *calibration,
                  options.odometry.empty() ? Odometry::Source::kLidar : Odometry::Source::kExternal,
                  print_log(),
                  *std::move(gps),
                  *is_new,
                  run.input,
                  parameters_text(*parameters, options),
                  options.checkpoint_s};
  if (!setup.new_session)
    if (const Status status = check_session(**store, setup.recording, setup.parameters); !status)
      return fail(status.error());
  auto slam = Slam::open(*store, *parameters, setup);
  if (!slam) return fail(slam.error());

  const fs::path out = options.out;
  auto writer =
      ResultWriter::create(out, ResultWriter::Existing::kReplace);  // whether there was a map is decided above
  if (!writer) return fail(writer.error());
  if (std::error_code failure; !options.resume && fs::exists(out / "tiles" / "tileset.json", failure))
    fs::remove_all(out / "tiles", failure);  // of another map
  std::vector<EvidenceFile> evidence;
  evidence.emplace_back(out / "evidence.csv", slam->last_frame());
  if (!options.into.empty()) {
    const auto last = slam->last_frame();
    const FrameId before{in_map(slam->session(), last.value_or(FrameId{0})).value - (last ? 0 : 1)};
    evidence.push_back(EvidenceFile::of_map(MapStore::file_of(options.into), before));
  }
  const auto viewer = options.is_viewed ? look_at(options.into.empty() ? out : fs::path(options.into))
                                        : Result<std::unique_ptr<ViewServer>>(nullptr);
  if (!viewer) return fail(viewer.error());
  listen_for_interrupt();
  Stopwatch watch;
  Status status = run_all(*slam, **recording, *odometry, options.sweep_s, evidence, run);
  run.ms_total["all"] = watch.lap_ms();
  run.counts["skipped"] = run.skipped.size();
  // What was found until here is written, whatever happened.
  const Status rows = write_rows(**store, slam->session(), *writer);
  const Status poses = !slam->has_keyframes() ? ok() : write_trajectories(*slam, **recording, out);
  const Status map = !slam->has_keyframes() || options.without_map ? ok() : write_map(*slam, out, run);
  const Status described = write_run(out / "run.json", run);
  for (const Status* each : {&std::as_const(status), &rows, &poses, &map, &described})
    if (!*each) return fail(each->error());

  if (!slam->has_keyframes()) return fail({options.input + ": no scan can be used"});
  std::cout << run.counts["scans"] << " scans, " << slam->graph().keyframes().size() << " key frames, "
            << run.counts["loops"] << " loops in the graph, " << run.counts["untracked"] << " scans not tracked, "
            << run.skipped.size() << " skipped\nTrajectory: " << (out / "poses.tum").string();
  if (!options.without_map) std::cout << "\nMap: " << (out / "map.ply").string() << ", " << (out / "map.png").string();
  std::cout << '\n';
  if (slam->session() > 0 && !slam->is_joined())
    print_log()(
        LogLevel::kWarning,
        "this session was not found in the map: it waits beside it, with coordinates of its own, until a session "
        "that passes through both joins them");
  if (!run.untracked.empty())
    print_log()(LogLevel::kWarning, "not tracked: frames " + to_ranges(run.untracked) +
                                        "; their poses are predicted (exit code 3; all of them in run.json)");
  if (run.interrupted) {
    print_log()(LogLevel::kWarning, "interrupted: continue with --resume");
    return kInterrupted;
  }
  if (*viewer) {
    std::cout << "Look at it: " << (*viewer)->address() << "   Ctrl-C ends." << std::endl;
    while (!interrupted()) std::this_thread::sleep_for(std::chrono::milliseconds(100));
  }
  return run.skipped.empty() && run.counts["untracked"] == 0 ? kDone : kDoneWithReservations;
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
