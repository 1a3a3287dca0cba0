// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <iostream>
#include <memory>

#include <Eigen/LU>

#include <revisit/core/stopwatch.hpp>
#include <revisit/core/text.hpp>
#include <revisit/io/pose_file.hpp>
#include <revisit/io/result_files.hpp>
#include <revisit/io/scan_file.hpp>
#include <revisit/pipeline/localiser.hpp>
#include <revisit/pipeline/recording_scale.hpp>

#include "common.hpp"
#include "progress.hpp"
#include "read_ahead.hpp"
#include "reports/run_file.hpp"

namespace revisit::cli {
namespace {

namespace fs = std::filesystem;

struct LocaliseOptions {
  std::string map, input, out;
  bool each = false;
  InputFlags recording;
  ParameterFlags parameters;
};

LocalisationRow to_row(const Localiser& localiser, const Localisation& found, double ms) {
  LocalisationRow row{.frame = found.frame,
                      .status = to_string(found.status),
                      .match = found.match,
                      .probability = found.probability,
                      .ms = ms,
                      .reason = found.reason};
  if (!found.T_map_lidar) return row;
  row.T_map_lidar = *found.T_map_lidar;
  row.T_match_lidar = localiser.map().T_map_lidar(found.match).inverse() * *found.T_map_lidar;
  if (!found.information.isZero()) {
    const Matrix6 weak = Vector6::Constant(1e-6).asDiagonal();
    const Matrix6 covariance = (found.information + weak).inverse();
    row.deviation_m = std::sqrt(covariance.diagonal().head<3>().sum());
    row.deviation_deg = to_degrees(std::sqrt(covariance.diagonal().tail<3>().sum()));
  }
  return row;
}

std::string in_words(const LocalisationRow& row) {
  if (!row.is_answered()) return "not found: " + row.reason;
  const Eigen::Vector3d t = row.T_map_lidar.translation();
  return format("at (%.2f, %.2f, %.2f) m in the map, heading %.1f degrees; probability %.4f; ", t.x(), t.y(), t.z(),
                to_degrees(yaw_of(row.T_map_lidar)), row.probability) +
         format("%.2f m from key ", row.T_match_lidar.translation().norm()) + revisit::to_text(row.match);
}

int localise_one(Localiser& localiser, const std::string& file) {
  auto scan = read_scan(file);
  if (!scan) return fail(scan.error());
  Stopwatch watch;
  const auto found = localiser.locate(*std::move(scan));
  if (!found) return fail(found.error());
  std::cout << in_words(to_row(localiser, *found, 0.0)) << format("  (%.0f ms)\n", watch.lap_ms());
  return found->T_map_lidar ? kDone : kDoneWithReservations;
}

struct Output {
  LocalisationWriter rows;
  Trajectory poses = {};
  RunFile run = {};
};

Status localise_all(Localiser& localiser, const Recording& recording, bool each, Output& output) {
  Progress progress("localise", "scans", recording.size());
  ReadAhead scans(recording);
  std::string status_before;
  for (std::size_t i = 0; i < recording.size() && !interrupted(); ++i) {
    auto scan = scans.next();
    Stopwatch watch;
    auto found = !scan  ? Result<Localisation>(scan.error())
                 : each ? localiser.locate(*std::move(scan))
                        : localiser.follow(*std::move(scan), recording.wheel_pose(i));
    const double ms = watch.lap_ms();
    output.run.ms_total["localise"] += ms;
    ++output.run.counts["scans"];
    if (!found) {
      progress.clear();
      print_log()(LogLevel::kWarning, found.error().message + "; skipped");
      output.run.skipped.push_back(found.error().message);
      progress.update(i + 1);
      continue;
    }
    const LocalisationRow row = to_row(localiser, *found, ms);
    ++output.run.counts[row.status];
    if (const Status status = output.rows.add(row); !status) return status;
    if (row.is_answered()) output.poses.entries[row.frame] = {recording.stamp_s(i), row.T_map_lidar};
    if (const bool is_lost = row.status == "lost"; !each && is_lost != (status_before == "lost")) {
      progress.clear();
      print_log()(LogLevel::kInfo,
                  revisit::to_text(row.frame) + (is_lost ? ": lost: " + row.reason : ": " + in_words(row)));
    }
    status_before = row.status;
    progress.update(i + 1);
  }
  output.run.interrupted = interrupted();
  return output.rows.finish();
}

int localise(const LocaliseOptions& options) {
  auto parameters = options.parameters.resolve();
  if (!parameters) return fail(parameters.error(), kUsage);
  if (!is_recording(options.input)) {
    auto localiser = Localiser::open(options.map, *parameters, print_log());
    return localiser ? localise_one(*localiser, options.input) : fail(localiser.error());
  }
  if (options.out.empty()) return fail({"a recording needs --out, the folder for the poses"}, kUsage);
  const auto recording = open_input(options.input, options.recording.options(), &*parameters);
  if (!recording) return fail(recording.error());
  const auto scale = intensity_scale_of(**recording, parameters->intensity);
  if (!scale) return fail({scale.error().message + "; no scan can be used"});
  auto localiser = Localiser::open(options.map, *parameters, print_log(), *scale);
  if (!localiser) return fail(localiser.error());

  const fs::path out = options.out;
  std::error_code failure;
  fs::create_directories(out, failure);
  if (failure) return fail({out.string() + ": cannot be created: " + failure.message()});
  Output output{LocalisationWriter(out / "localisation.csv")};
  RunFile& run = output.run;
  run.command = "localise";
  run.arguments = program_arguments();
  run.input = fs::absolute(options.input).lexically_normal().string();
  run.database = fs::absolute(options.map).lexically_normal().string();
  run.topic = options.recording.options().topic;
  run.parameters = *parameters;
  run.intensity = *scale;
  run.counts["database_places"] = localiser->places();
  listen_for_interrupt();
  const Status status = localise_all(*localiser, **recording, options.each, output);
  const Status poses = write_tum_poses(out / "poses.tum", output.poses);
  const Status described = write_run(out / "run.json", run);
  for (const Status* each : {&status, &poses, &described})
    if (!*each) return fail(each->error());

  std::cout << run.counts["scans"] << " scans: " << run.counts["found"] << " found, " << run.counts["followed"]
            << " followed, " << run.counts["predicted"] << " predicted, " << run.counts["lost"] << " lost, "
            << run.skipped.size() << " skipped\nPoses in the map: " << (out / "poses.tum").string() << ", "
            << (out / "localisation.csv").string() << '\n';
  if (run.interrupted) return kInterrupted;
  return run.skipped.empty() ? kDone : kDoneWithReservations;
}

}  // namespace

Run add_localise(CLI::App& program) {
  auto options = std::make_shared<LocaliseOptions>();
  CLI::App* command =
      program.add_subcommand("localise", "Tell where a scan, or each scan of a recording, is in a map.");
  command->footer(
      "A scan is looked for in the whole map, without a prior: its pose is printed, or why it is not found (exit code "
      "3).\n"
      "A sensor that looks one way (less than half round) needs a drive of some metres in streets, and any sensor\n"
      "often needs 15 m and more in rooms: others look alike.\n"
      "A recording is found the same way, then followed; where it gets lost it is found again. Into the folder of "
      "--out:\n"
      "  localisation.csv  a row a scan: status (found, followed, predicted, lost), pose in the map, probability\n"
      "  poses.tum         the poses, by the recording's times\n"
      "  run.json          version, parameters, counts, milliseconds\n\n"
      "Example: revisit localise maps/00 scan.pcd\n"
      "         revisit localise maps/00 tuesday.bag --out where");
  command->add_option("map", options->map, "Map of `revisit slam`: the file, or the folder of --out")->required();
  command
      ->add_option("input", options->input, "A scan (.bin, .pcd, .ply, .las), or a recording as for `revisit detect`")
      ->required();
  command->add_option("--out", options->out, "Folder for the results of a recording");
  command->add_flag("--each", options->each, "Look for each scan of the recording alone, as if there were no other");
  options->recording.add_to(*command);
  options->parameters.add_to(*command);
  return [options] { return localise(*options); };
}

}  // namespace revisit::cli
