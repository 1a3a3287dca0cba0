// SPDX-License-Identifier: Apache-2.0
#include <cstdio>
#include <iostream>
#include <memory>

#include <revisit/io/scan_file.hpp>

#include "common.hpp"
#include "scan_pictures.hpp"

namespace revisit::cli {
namespace {

struct Options {
  std::string scan, picture, calibration;
  ParameterFlags parameters;
};

int describe(const Options& options) {
  const auto parameters = options.parameters.resolve();
  if (!parameters) return fail(parameters.error(), kUsage);
  const auto calibration = load_calibration(options.calibration);
  if (!calibration) return fail(calibration.error());
  if (const Status status = check_output(options.picture, ".png"); !status) return fail(status.error(), kUsage);
  if (std::error_code failure; std::filesystem::is_directory(options.scan, failure))
    return fail({options.scan + ": is a folder; name one scan of it"});
  auto scan = read_scan(options.scan, print_log());
  if (!scan) return fail(scan.error());
  const IntensityScale scale = estimate_intensity_scale(std::span<const Scan>(&*scan, 1), parameters->intensity);
  if (!scale.warning.empty()) print_log()(LogLevel::kWarning, options.scan + ": " + scale.warning);
  const auto prepared = prepare_scan(*std::move(scan), *parameters, scale, *calibration);
  if (!prepared) return fail({options.scan + ": " + prepared.error().message});

  const std::string name = std::filesystem::path(options.scan).filename().string();
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
  auto options = std::make_shared<Options>();
  CLI::App* command = program.add_subcommand("describe", "Draw one scan from above beside its descriptor.");
  command->footer("Example: revisit describe 000042.bin --out scan.png --preset paper");
  command->add_option("scan", options->scan, "Scan: .bin, .pcd or .ply")->required();
  command->add_option("--out", options->picture, "The picture to write, .png")->required();
  command->add_option("--calibration", options->calibration, "Intensity calibration made by `revisit calibrate`");
  options->parameters.add_to(*command, {"preprocess", "intensity", "descriptor"});
  return [options] { return describe(*options); };
}

}  // namespace revisit::cli
