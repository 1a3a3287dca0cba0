// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <revisit/config/parameters.hpp>
#include <revisit/core/result.hpp>
#include <revisit/preprocess/intensity.hpp>

#include "reports/memory_use.hpp"

namespace revisit::cli {

/// run.json: what was run, on what, and what it cost.
struct RunFile {
  std::string command, input, topic, database, poses, calibration;
  std::vector<std::string> arguments;  ///< as given to the program
  Parameters parameters;
  IntensityScale intensity;
  std::map<std::string, std::size_t> counts;
  std::map<std::string, double> ms_total;  ///< by stage, over all scans
  MemoryUse memory;
  std::vector<std::string> skipped;     ///< why each scan was left out
  std::vector<std::int64_t> untracked;  ///< frames whose pose is predicted only (slam)
  bool interrupted = false;
};

Status write_run(const std::filesystem::path& file, const RunFile& run);

/// What later commands need of a run; absent entries where the file does not have them.
struct RunFacts {
  std::string input, topic, database, calibration;
  Parameters parameters;  ///< defaults where the file says nothing, or what this version does not know
  bool interrupted = false;
  std::optional<int> exclude_frames;
  std::optional<double> exclude_s;
};
Result<RunFacts> read_run(const std::filesystem::path& file);

}  // namespace revisit::cli
