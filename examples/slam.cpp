// SPDX-License-Identifier: Apache-2.0
// Scans in, trajectory and map out: example_slam RECORDING FOLDER
#include <cstdio>

#include <revisit/io/pose_file.hpp>
#include <revisit/io/recording.hpp>
#include <revisit/pipeline/slam.hpp>

int main(int, char** argv) {
  const auto recording = revisit::open_recording(argv[1]);
  auto slam = revisit::Slam::open(argv[2]);  // or, for a map that is not kept: revisit::Slam slam;
  if (!recording || !slam) return std::puts("no recording, or no such folder"), 1;
  for (std::size_t i = 0; i < (*recording)->size(); ++i)
    if (auto scan = (*recording)->read(i)) (void)slam->process(*std::move(scan));
  const auto finished = slam->finish();
  const auto trajectories = slam->trajectories();
  const auto map = slam->map();
  if (!finished || !trajectories || !map) return std::puts("the map cannot be kept"), 1;
  (void)revisit::write_tum_poses("poses.tum", trajectories->corrected);
  std::printf("%zu poses, %zu points\n", trajectories->corrected.entries.size(), map->size());
}
