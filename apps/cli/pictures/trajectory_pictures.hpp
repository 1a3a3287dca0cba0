// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include <revisit/core/pose.hpp>
#include <revisit/core/result.hpp>
#include <revisit/evaluation/trajectory_table.hpp>

namespace revisit::cli {

/// A trajectory and how far it is from the truth.
struct JudgedTrajectory {
  Trajectory trajectory;
  TrajectoryTable table;
};

/// Side by side, without and with loop closing: the trajectory over the reference, and over the map where `cloud`, a
/// map.ply, is there. Odometry starts where the reference starts, so that drift shows; the corrected trajectory is
/// aligned as a whole.
Status draw_trajectories(const std::filesystem::path& file, const Trajectory& reference, const JudgedTrajectory& before,
                         const JudgedTrajectory& after, const std::filesystem::path& cloud);

}  // namespace revisit::cli
