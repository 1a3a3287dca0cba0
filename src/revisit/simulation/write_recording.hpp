// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>

#include <revisit/simulation/simulated_recording.hpp>

namespace revisit {

/// Writes the recording as a KITTI odometry folder with the time and line of each point beside (docs/formats.md),
/// wheel_odometry.tum, odometry.tum and simulation.toml, from which it can be made again. Poses and times come first,
/// so that a run that is cut short leaves a recording. `on_scan(done)` is called from one thread at a time and ends the
/// run by returning false. A folder that holds anything already is an error.
Status write_recording(const SimulatedRecording& recording, const std::filesystem::path& folder, int threads = 0,
                       const std::function<bool(std::size_t)>& on_scan = {});

}  // namespace revisit
