// SPDX-License-Identifier: Apache-2.0
#include <iostream>
#include <memory>

#include <revisit/io/convert_recording.hpp>
#include <revisit/simulation/write_recording.hpp>

#include "common.hpp"
#include "progress.hpp"

namespace revisit::cli {
namespace {

struct SimulateOptions {
  std::string out;
  ParameterFlags parameters;
};

int run_simulation(const SimulateOptions& options) {
  const auto parameters = options.parameters.resolve();
  if (!parameters) return fail(parameters.error(), kUsage);
  const auto recording = simulate(parameters->simulation, print_log());
  if (!recording) return fail(recording.error());

  listen_for_interrupt();
  std::size_t written = 0;
  Status status = ok();
  {
    Progress progress("simulate", "scans", (*recording)->size());
    const auto on_scan = [&](std::size_t done) {
      progress.update(written = done);
      return !interrupted();
    };
    if (is_bag_name(options.out)) {
      const auto converted = convert_recording(**recording, options.out, print_log(), on_scan);
      if (!converted) status = converted.error();
    } else {
      status = write_recording(**recording, options.out, 0, on_scan);
    }
  }
  if (!status) return fail(status.error());
  std::cout << written << " scans of a " << (*recording)->kind() << ": " << options.out << "\n";
  if (interrupted()) {
    print_log()(LogLevel::kWarning, "interrupted: the recording holds the scans until here");
    return kInterrupted;
  }
  return kDone;
}

}  // namespace

Run add_simulate(CLI::App& program) {
  auto options = std::make_shared<SimulateOptions>();
  CLI::App* command =
      program.add_subcommand("simulate", "Drive a LiDAR through a town, a warehouse or a building, with exact truth.");
  command->footer(
      "Writes a bag that ROS reads, where the name ends in .bag, .mcap or .db3 (topics /points, /odom, /tf_static "
      "and,\n"
      "with --imu true, /imu; the exact poses stand beside it), else a KITTI odometry folder (formats: "
      "docs/formats.md):\n"
      "  velodyne/           the scans; beside it velodyne_times/ and velodyne_rings/, one value a point\n"
      "  poses.txt times.txt calib.txt\n"
      "                      the exact poses, at the middle of each sweep\n"
      "  wheel_odometry.tum odometry.tum\n"
      "                      what wheels and a drifting odometry say\n"
      "  simulation.toml     all of the above as parameters: `revisit detect simulation.toml --out results` drives it\n"
      "                      again without writing a scan\n\n"
      "Example: revisit simulate --out drive --sensor vlp16 --length_m 500\n"
      "         revisit simulate --out drive.mcap --imu true\n"
      "         revisit simulate --out kitti00 --trajectory kitti/poses/00.txt --seed 7");
  command->add_option("--out", options->out, "New or empty folder, or new bag")->required();
  options->parameters.add_to(*command, {"simulation"}, ParameterFlags::Names::kShort);
  return [options] { return run_simulation(*options); };
}

}  // namespace revisit::cli
