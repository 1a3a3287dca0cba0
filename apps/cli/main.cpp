// SPDX-License-Identifier: Apache-2.0
#include <cstdio>
#include <exception>
#include <new>
#include <optional>
#include <utility>
#include <vector>

#include <oneapi/tbb/global_control.h>

#include <revisit/bits/instruction_sets.hpp>

#include "common.hpp"

namespace revisit::cli {
namespace {

Status use_instruction_set(const std::string& wanted) {
  std::string known;
  for (const std::int64_t each : supported_instruction_sets()) {
    force_instruction_set(each);
    if (instruction_set_name() == wanted) return ok();
    known += std::string(" ") + instruction_set_name();
    force_instruction_set(0);
  }
  return Error{"--simd " + wanted + ": this processor has" + known};
}

int run_program(int argc, char** argv) {
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
  program.fallthrough();  // these may stand behind the command, too
  int threads = 0;
  std::string instruction_set;
  program.add_option("--threads", threads, "Threads to work on; 0 for all. No result depends on it")
      ->check(CLI::Range(0, 1024));
  program.add_option("--simd", instruction_set, "Vector instructions to use instead of the best there are, e.g. AVX2");
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
  std::optional<tbb::global_control> limit;
  if (threads > 0) limit.emplace(tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(threads));
  if (!instruction_set.empty())
    if (const auto used = use_instruction_set(instruction_set); !used) return fail(used.error(), kUsage);
  for (const auto& [command, run] : commands)
    if (command->parsed()) return run();
  return kUsage;
}

}  // namespace
}  // namespace revisit::cli

int main(int argc, char** argv) {
  try {
    return revisit::cli::run_program(argc, argv);
  } catch (const std::bad_alloc&) {  // says so without asking for more
    std::fputs("error: there is not enough memory\n", stderr);
  } catch (const std::exception& problem) {  // our own bug
    std::fprintf(stderr, "error: internal error: %s\n", problem.what());
  }
  return revisit::cli::kFailed;
}
