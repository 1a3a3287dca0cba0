// SPDX-License-Identifier: Apache-2.0
// Reads one scan and describes it: example_one_scan SCAN
#include <cstdio>

#include <revisit/descriptors/intensity_scan_context.hpp>
#include <revisit/io/scan_file.hpp>
#include <revisit/preprocess/intensity.hpp>

int main(int argc, char** argv) {
  if (argc != 2) return std::puts("usage: example_one_scan SCAN.{bin,pcd,ply}"), 2;
  auto scan = revisit::read_scan(argv[1]);
  if (!scan) return std::puts(scan.error().message.c_str()), 1;

  // Intensity in [0, 1], whatever unit the sensor writes.
  const auto scale = revisit::estimate_intensity_scale(std::span<const revisit::Scan>(&*scan, 1), {});
  revisit::normalise_intensity(*scan, scale);

  const revisit::IntensityScanContext context = revisit::describe(scan->points, revisit::DescriptorOptions{});
  std::printf("%zu points -> %d rings x %d sectors, %d cells occupied\n", scan->points.size(), context.rings,
              context.sectors, context.occupied_cells());
}
