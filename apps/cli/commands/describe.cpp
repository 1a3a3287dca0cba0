// SPDX-License-Identifier: Apache-2.0
#include <cstdio>
#include <iostream>
#include <memory>
#include <optional>

#include <revisit/io/scan_file.hpp>

#include "common.hpp"
#include "pictures/scan_pictures.hpp"

namespace revisit::cli {
namespace {

struct DescribeOptions {
  std::string scan, picture, calibration;
  std::optional<std::int64_t> frame;
  InputFlags recording;
  ParameterFlags parameters;
};

// The scan in the file, or the one of that frame in the recording.
Result<Scan> read_input(const DescribeOptions& options) {
  if (!is_recording(options.scan)) return read_scan(options.scan, print_log());
  if (!options.frame) return Error{options.scan + ": is a recording; name a scan of it with --frame"};
  const auto recording = open_input(options.scan, options.recording.options());
  if (!recording) return recording.error();
  for (std::size_t i = 0; i < (*recording)->size(); ++i)
    if ((*recording)->frame(i).value == *options.frame) return (*recording)->read(i);
  return Error{options.scan + ": has no frame " + std::to_string(*options.frame) +
               "; allowed: " + std::to_string((*recording)->frame(0).value) + " to " +
               std::to_string((*recording)->frame((*recording)->size() - 1).value)};
}

int describe(const DescribeOptions& options) {
  const auto parameters = options.parameters.resolve();
  if (!parameters) return fail(parameters.error(), kUsage);
  const auto calibration = load_calibration(options.calibration);
  if (!calibration) return fail(calibration.error());
  if (const Status status = check_output(options.picture, ".png"); !status) return fail(status.error(), kUsage);
  if (options.frame && !is_recording(options.scan))
    return fail({options.scan + ": is one scan; --frame is for recordings"}, kUsage);
  auto scan = read_input(options);
  if (!scan) return fail(scan.error());
  const IntensityScale scale = estimate_intensity_scale(std::span<const Scan>(&*scan, 1), parameters->intensity);
  if (!scale.warning.empty()) print_log()(LogLevel::kWarning, options.scan + ": " + scale.warning);
  const auto prepared = prepare_scan(*std::move(scan), *parameters, scale, *calibration);
  if (!prepared) return fail({options.scan + ": " + prepared.error().message});

  std::string name = std::filesystem::path(options.scan).filename().string();
  if (options.frame) name += " frame " + std::to_string(*options.frame);
  const auto& ground = prepared->ground;
  char title[256];
  std::snprintf(title, sizeof title, "%s: %zu points, laser rings: %s (%zu), intensity full scale %.4g", name.c_str(),
                prepared->scan.points.size(), to_string(ground.rings).c_str(), ground.ring_count, scale.full_scale);
  if (const Status status = draw_description(options.picture, *prepared, *parameters, title); !status)
    return fail(status.error());
  std::cout << title << "\n" << options.picture << "\n";
  return scale.is_reflectance ? kDone : kDoneWithReservations;
}

}  // namespace

Run add_describe(CLI::App& program) {
  auto options = std::make_shared<DescribeOptions>();
  CLI::App* command =
      program.add_subcommand("describe", "Draw one scan from above and from the side, with its descriptor.");
  command->footer(
      "Example: revisit describe 000042.bin --out scan.png --preset paper\n"
      "         revisit describe kitti/sequences/00 --frame 42 --out scan.png");
  command->add_option("scan", options->scan, "Scan: .bin, .pcd, .ply or .las; or a recording")->required();
  command->add_option("--frame", options->frame, "Which scan of the recording");
  command->add_option("--out", options->picture, "The picture to write, .png")->required();
  command->add_option("--calibration", options->calibration, "Intensity calibration made by `revisit calibrate`");
  options->recording.add_to(*command);
  options->parameters.add_to(*command, {"preprocess", "intensity", "descriptor"});
  return [options] { return describe(*options); };
}

}  // namespace revisit::cli
