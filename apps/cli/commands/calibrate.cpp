// SPDX-License-Identifier: Apache-2.0
#include <cstdio>
#include <memory>

#include <revisit/io/calibration_file.hpp>
#include <revisit/pipeline/calibrate_recording.hpp>

#include "common.hpp"
#include "progress.hpp"

namespace revisit::cli {
namespace {

struct CalibrateOptions {
  std::string input, out, poses;
  std::size_t scans = 100;
  InputFlags recording;
  ParameterFlags parameters;
};

int calibrate(const CalibrateOptions& options) {
  const auto parameters = options.parameters.resolve();
  if (!parameters) return fail(parameters.error(), kUsage);
  if (const Status status = check_output(options.out, ""); !status) return fail(status.error(), kUsage);
  // An earlier calibration may be replaced, nothing else.
  if (std::error_code failure; std::filesystem::is_regular_file(options.out, failure) && !read_calibration(options.out))
    return fail({options.out + ": exists and is no calibration; name another file"}, kUsage);
  const auto recording = open_input(options.input, options.recording.options(options.poses));
  if (!recording) return fail(recording.error());
  listen_for_interrupt();
  Result<RecordingCalibration> report = Error{};
  {
    std::optional<Progress> progress;
    report = calibrate_recording(**recording, *parameters, options.scans, print_log(),
                                 [&](std::size_t done, std::size_t total) {
                                   if (!progress) progress.emplace("calibrate", "scans", total);
                                   progress->update(done);
                                   return !interrupted();
                                 });
  }
  if (!report) return fail({options.input + ": " + report.error().message}, interrupted() ? kInterrupted : kFailed);
  if (const Status status = write_calibration(options.out, report->calibration); !status) return fail(status.error());

  const IntensityCalibration& phi = report->calibration;
  std::printf("distance (m)  gain\n");
  for (std::size_t i = 0; i < phi.distance_gains.size(); ++i)
    std::printf("%12.0f  %.3f\n", phi.distance_knots_m[i], phi.distance_gains[i]);
  if (!phi.ring_gains.empty()) {
    const auto [least, most] = std::minmax_element(phi.ring_gains.begin(), phi.ring_gains.end());
    std::printf("%zu rings, gains %.3f to %.3f\n", phi.ring_gains.size(), *least, *most);
  }
  if (report->elevation)
    std::printf("elevations: %+.3f degrees to be added (standard deviation %.3f, %zu pairs of scans)\n",
                report->elevation->offset_deg, report->elevation->deviation_deg, report->elevation->pairs);
  std::printf(
      "disagreement of %zu surface patches (half of them not learnt from): %.4f before, %.4f after (%.1f %% "
      "less)\n%s\n",
      report->patches, report->disagreement_before, report->disagreement_after,
      100.0 * (1.0 - report->disagreement_after / report->disagreement_before), options.out.c_str());
  return kDone;
}

}  // namespace

Run add_calibrate(CLI::App& program) {
  auto options = std::make_shared<CalibrateOptions>();
  CLI::App* command = program.add_subcommand(
      "calibrate",
      "Learn from a recording how intensity falls with distance, how rings differ, and whether elevations are off.");
  command->footer(
      "The same small surface seen from different distances should read the same. What makes it so is written to\n"
      "FILE, for `--calibration FILE` of detect and describe. The disagreement is measured on patches that were not\n"
      "learnt from: 0 = a surface always reads the same, 1 = its reading says nothing.\n"
      "Of sensors with 60 rings and more, elevations are compared as well: flat ground must stay flat. What is "
      "printed\n"
      "may be given to every command as --preprocess.elevation_offset_deg.\n\n"
      "Example: revisit calibrate kitti/sequences/00 --out hdl64.json");
  command->add_option("recording", options->input, "Recording of a moving sensor")->required();
  command->add_option("--out", options->out, "The calibration to write (JSON)")->required();
  command->add_option("--scans", options->scans, "Learn from the first scans only")
      ->capture_default_str()
      ->check(CLI::Range(2, 200));
  command->add_option("--poses", options->poses, "Pose file (KITTI, TUM, g2o), instead of the recording's own poses");
  options->recording.add_to(*command);
  options->parameters.add_to(*command, {"preprocess", "intensity", "geometric"});
  return [options] { return calibrate(*options); };
}

}  // namespace revisit::cli
