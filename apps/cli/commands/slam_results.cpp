// SPDX-License-Identifier: Apache-2.0
#include "commands/slam_results.hpp"

#include <iostream>
#include <string>
#include <utility>
#include <vector>

#include <revisit/core/stopwatch.hpp>
#include <revisit/io/pose_file.hpp>

#include "common.hpp"
#include "pictures/map_picture.hpp"
#include "progress.hpp"

namespace revisit::cli {
namespace {

namespace fs = std::filesystem;

// "3 to 7, 12": the first few runs of consecutive frames.
std::string to_ranges(const std::vector<std::int64_t>& frames) {
  constexpr int kMost = 8;
  std::string text;
  int ranges = 0;
  for (std::size_t begin = 0, end = 0; begin < frames.size(); begin = end) {
    for (end = begin + 1; end < frames.size() && frames[end] == frames[end - 1] + 1;) ++end;
    if (++ranges > kMost) return text + ", ...";
    text += (text.empty() ? "" : ", ") + std::to_string(frames[begin]);
    if (end - begin > 1) text += " to " + std::to_string(frames[end - 1]);
  }
  return text;
}

}  // namespace

void count(RunFile& run, const SlamStep& step) {
  ++run.counts["scans"];
  run.counts["keyframes"] += step.is_keyframe;
  run.counts["untracked"] += !step.is_tracked;
  run.counts["segments_begun"] += step.starts_segment;
  if (!step.is_tracked) run.untracked.push_back(step.frame.value);
  run.counts["loops"] += step.loops_entered;
  for (const auto& [stage, value] : {std::pair{"odometry", step.ms.odometry},
                                     {"prepare", step.ms.prepare},
                                     {"detect", step.ms.detect},
                                     {"graph", step.ms.graph},
                                     {"store", step.ms.store}})
    run.ms_total[stage] += value;
}

Status write_rows(const MapStore& store, int session, ResultWriter& writer) {
  const auto answers = store.answers();
  const auto edges = store.edges();
  if (!answers) return answers.error();
  if (!edges) return edges.error();
  const auto is_own = [session](FrameId frame) { return session_of(frame) == session; };
  for (CandidateRow row : *answers) {
    if (!is_own(row.query) || (row.match && !is_own(*row.match))) continue;
    row.query = in_recording(row.query);
    if (row.match) row.match = in_recording(*row.match);
    if (const Status status = writer.add(row); !status) return status;
  }
  for (const StoredEdge& edge : *edges) {
    if (!edge.loop || !is_own(edge.from) || !is_own(edge.to)) continue;
    LoopConstraint loop = *edge.loop;
    loop.query = in_recording(loop.query);
    loop.match = in_recording(loop.match);
    if (const Status status = writer.add(loop); !status) return status;
  }
  return writer.finish();
}

Status write_trajectories(const Slam& slam, const Recording& recording, const fs::path& out) {
  const auto trajectories = slam.trajectories();
  if (!trajectories) return trajectories.error();
  const auto T_camera_lidar = recording.T_camera_lidar();
  if (T_camera_lidar)
    if (const Status status = write_camera_calibration(out / "calib.txt", *T_camera_lidar); !status) return status;
  for (const Status& status : {write_kitti_poses(out / "poses.txt", trajectories->corrected, T_camera_lidar),
                               write_tum_poses(out / "poses.tum", trajectories->corrected),
                               write_tum_poses(out / "odometry.tum", trajectories->odometry),
                               slam.graph().graph().write_g2o(out / "graph.g2o")})
    if (!status) return status;
  return ok();
}

Status write_map(const Slam& slam, const fs::path& out, RunFile& run) {
  Stopwatch watch;
  Progress progress("map", "key frames", slam.graph().keyframes().size());
  const auto report = slam.write_map(out, [&](std::size_t done) {
    progress.update(done);
    return true;
  });
  if (!report) return report.error();
  run.counts["map_points"] = report->points;
  run.counts["moving_points_left_out"] = report->moving;
  run.ms_total["map"] = watch.lap_ms();
  return draw_map(out / "map.png", out / "map.ply", slam.graph().graph().nodes());
}

void tell_result(const Slam& slam, const RunFile& run, const fs::path& out, bool has_map) {
  const auto number_of = [&](const char* what) {
    const auto found = run.counts.find(what);
    return found == run.counts.end() ? 0 : found->second;
  };
  std::cout << number_of("scans") << " scans, " << slam.graph().keyframes().size() << " key frames, "
            << number_of("loops") << " loops in the graph, " << number_of("untracked") << " scans not tracked, "
            << run.skipped.size() << " skipped\nTrajectory: " << (out / "poses.tum").string();
  if (has_map) std::cout << "\nMap: " << (out / "map.ply").string() << ", " << (out / "map.png").string();
  std::cout << '\n';
  if (slam.session() > 0 && !slam.is_joined())
    print_log()(
        LogLevel::kWarning,
        "this session was not found in the map: it waits beside it, with coordinates of its own, until a session "
        "that passes through both joins them");
  if (!run.untracked.empty())
    print_log()(LogLevel::kWarning, "not tracked: frames " + to_ranges(run.untracked) +
                                        "; their poses are predicted (exit code 3; all of them in run.json)");
  if (run.interrupted) print_log()(LogLevel::kWarning, "interrupted: continue with --resume");
}

}  // namespace revisit::cli
