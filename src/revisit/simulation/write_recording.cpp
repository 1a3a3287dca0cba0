// SPDX-License-Identifier: Apache-2.0
#include <revisit/core/text.hpp>
#include <revisit/simulation/write_recording.hpp>

#include <atomic>
#include <mutex>

#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/task_arena.h>

#include <revisit/config/parameter_file.hpp>
#include <revisit/io/pose_file.hpp>
#include <revisit/io/result_files.hpp>
#include <revisit/simulation/internal/threads.hpp>

namespace revisit {
namespace {

namespace fs = std::filesystem;

Status make_folder(const fs::path& folder) {
  std::error_code failure;
  if (fs::exists(folder, failure) && (!fs::is_directory(folder, failure) || !fs::is_empty(folder, failure)))
    return Error{folder.string() + ": holds something already; name a new or empty folder"};
  fs::create_directories(folder, failure);
  if (failure) return Error{folder.string() + ": cannot be made: " + failure.message()};
  return ok();
}

Status write_facts(const SimulatedRecording& recording, const fs::path& folder) {
  std::string times;
  for (std::size_t i = 0; i < recording.size(); ++i) times += format("%.6f\n", recording.stamp_s(i));
  Parameters parameters;
  parameters.simulation = recording.options();
  if (std::string& file = parameters.simulation.trajectory; !file.empty()) file = fs::absolute(file).string();
  for (const Status& status :
       {write_text(folder / "times.txt", times),
        write_camera_calibration(folder / "calib.txt", *recording.T_camera_lidar()),
        write_kitti_poses(folder / "poses.txt", recording.trajectory(), recording.T_camera_lidar()),
        write_tum_poses(folder / "wheel_odometry.tum", recording.wheel_odometry()),
        write_tum_poses(folder / "odometry.tum", recording.drifting_odometry()),
        write_text(folder / "simulation.toml", to_toml(parameters, "simulation"))})
    if (!status) return status;
  return ok();
}

}  // namespace

Status write_recording(const SimulatedRecording& recording, const fs::path& folder, int threads,
                       const std::function<bool(std::size_t)>& on_scan) {
  if (const Status made = make_folder(folder); !made) return made;
  if (const Status written = write_facts(recording, folder); !written) return written;

  std::atomic<bool> stop = false;
  std::atomic<std::size_t> next = 0;
  std::mutex mutex;
  Status result = ok();
  std::size_t done = 0;
  const auto work = [&] {
    for (std::size_t i = next++; i < recording.size() && !stop; i = next++) {
      const auto scan = recording.read(i);
      const Status status = scan ? write_kitti_scan(folder, *scan) : Status(scan.error());
      const std::lock_guard lock(mutex);
      if (!status && result) result = status;
      if (!status || (on_scan && !on_scan(++done))) stop = true;
    }
  };
  // Scans are taken in order, one a thread, so that a run that is cut short leaves no holes.
  tbb::task_arena arena(simulation_internal::threads_to_use(threads));
  arena.execute([&] {
    tbb::parallel_for(
        0, arena.max_concurrency(), [&](int) { work(); }, tbb::simple_partitioner());
  });
  return result;
}

}  // namespace revisit
