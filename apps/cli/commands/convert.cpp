// SPDX-License-Identifier: Apache-2.0
#include <iostream>
#include <memory>

#include <revisit/io/convert_recording.hpp>

#include "common.hpp"
#include "progress.hpp"

namespace revisit::cli {
namespace {

struct ConvertOptions {
  std::string input, out, poses;
  InputFlags recording;
};

int convert(const ConvertOptions& options) {
  const auto recording = open_input(options.input, options.recording.options(options.poses));
  if (!recording) return fail(recording.error());
  listen_for_interrupt();
  Progress progress("convert", "scans", (*recording)->size());
  const auto converted = convert_recording(**recording, options.out, print_log(), [&](std::size_t done) {
    progress.update(done);
    return !interrupted();
  });
  progress.clear();
  if (!converted) return fail(converted.error());
  std::cout << converted->scans << " scans, " << converted->skipped << " skipped: " << options.out << "\n";
  if (interrupted()) {
    print_log()(LogLevel::kWarning, "interrupted: " + options.out + " holds the scans until here");
    return kInterrupted;
  }
  if (converted->scans == 0) return fail({options.input + ": no scan can be used"});
  return converted->skipped == 0 ? kDone : kDoneWithReservations;
}

}  // namespace

Run add_convert(CLI::App& program) {
  auto options = std::make_shared<ConvertOptions>();
  CLI::App* command = program.add_subcommand("convert", "Write a recording as a KITTI folder, or as a bag.");
  command->footer(
      "A name that ends in .bag, .mcap or .db3 becomes a bag that ROS reads, with the topics /points, /tf_static and,\n"
      "where they are known, /imu and /odom; exact poses stand beside it as NAME.poses.tum. Any other name becomes a\n"
      "KITTI odometry folder with the time and ring of each point (formats: docs/formats.md).\n\n"
      "Example: revisit convert drive.bag --out drive_kitti\n"
      "         revisit convert kitti/sequences/00 --out 00.mcap");
  command->add_option("input", options->input, kRecordingHelp)->required();
  command->add_option("--out", options->out, "New or empty folder, or new bag")->required();
  command->add_option("--poses", options->poses, "Pose file (KITTI, TUM, g2o) to be written with the scans");
  options->recording.add_to(*command);
  return [options] { return convert(*options); };
}

}  // namespace revisit::cli
