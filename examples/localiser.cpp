// SPDX-License-Identifier: Apache-2.0
// Where am I in the map of an earlier run? example_localiser MAP SCAN
#include <cstdio>

#include <revisit/io/scan_file.hpp>
#include <revisit/pipeline/localiser.hpp>

int main(int, char** argv) {
  auto localiser = revisit::Localiser::open(argv[1]);
  if (!localiser) return std::puts(localiser.error().message.c_str()), 1;
  auto scan = revisit::read_scan(argv[2]);
  if (!scan) return std::puts(scan.error().message.c_str()), 1;
  const auto found = localiser->locate(*std::move(scan));
  if (!found) return std::puts(found.error().message.c_str()), 1;
  if (!found->T_map_lidar) return std::printf("not found: %s\n", found->reason.c_str()), 0;
  const Eigen::Vector3d t = found->T_map_lidar->translation();
  std::printf("at (%.2f, %.2f, %.2f) m in the map; probability %.3f\n", t.x(), t.y(), t.z(), found->probability);
}
