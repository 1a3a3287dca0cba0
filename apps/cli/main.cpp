// SPDX-License-Identifier: Apache-2.0
#include <exception>
#include <utility>
#include <vector>

#include "common.hpp"

int main(int argc, char** argv) {
  using namespace revisit::cli;
  CLI::App program(
      "revisit recognises places that a LiDAR has seen before, and closes the loop.\n\n"
      "A first run:\n"
      "  revisit info RECORDING                     what is in there\n"
      "  revisit detect RECORDING --out results     find the loops\n"
      "  revisit slam RECORDING --out map           trajectory and map\n"
      "  revisit localise map SCAN                  where in the map is this scan?\n"
      "  revisit evaluate results --reference POSES score them, draw them\n"
      "  revisit view map                           look at it in a browser\n\n"
      "RECORDING is a ROS bag (.bag, .mcap, .db3, or a folder of them), a packet capture (.pcap), a KITTI odometry "
      "folder "
      "or\n"
      "raw drive, a folder of .bin, .pcd, .ply or .las scans, or the .toml of a simulated drive. Without any: revisit "
      "simulate\n"
      "--out RECORDING.\n"
      "Exit code: 0 done, 1 failed, 2 wrong usage, 3 done but with scans skipped, scans not tracked (slam; named at "
      "the\n"
      "end) or without usable intensity, 130 interrupted (what was computed until then is written).",
      "revisit");
  program.set_version_flag("--version", REVISIT_VERSION);
  program.require_subcommand(1);
  program.get_formatter()->column_width(38);

  program_arguments().assign(argv + 1, argv + argc);
  std::vector<std::pair<CLI::App*, Run>> commands;
  for (const auto add :
       {add_info, add_describe, add_detect, add_slam, add_localise, add_merge, add_export, add_evaluate, add_view,
        add_compare, add_calibrate, add_simulate, add_convert, add_parameters}) {
    Run run = add(program);
    commands.emplace_back(program.get_subcommands({}).back(), std::move(run));
  }
  try {
    program.parse(argc, argv);
  } catch (const CLI::ParseError& problem) {
    return program.exit(problem) == 0 ? kDone : kUsage;
  }
  try {
    for (const auto& [command, run] : commands)
      if (command->parsed()) return run();
  } catch (const std::exception& problem) {  // our own bug, or no memory
    return fail({std::string("internal error: ") + problem.what()});
  }
  return kUsage;
}
