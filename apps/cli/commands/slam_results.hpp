// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include <revisit/io/recording.hpp>
#include <revisit/io/result_files.hpp>
#include <revisit/pipeline/slam.hpp>

#include "reports/run_file.hpp"

namespace revisit::cli {

/// Adds a scan to what run.json says.
void count(RunFile& run, const SlamStep& step);

/// Answers and loops within this session, by the frames of its recording.
Status write_rows(const MapStore& store, int session, ResultWriter& writer);
/// The corrected trajectory, that of odometry, and the graph.
Status write_trajectories(const Slam& slam, const Recording& recording, const std::filesystem::path& out);
/// The map and its picture.
Status write_map(const Slam& slam, const std::filesystem::path& out, RunFile& run);

/// Says on the console what came of the run, and what of it needs attention.
void tell_result(const Slam& slam, const RunFile& run, const std::filesystem::path& out, bool has_map);

}  // namespace revisit::cli
