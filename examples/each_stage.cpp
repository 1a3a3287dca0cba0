// SPDX-License-Identifier: Apache-2.0
// Every stage by itself, for those who want to exchange one: example_each_stage EARLIER LATER
#include <cstdio>
#include <vector>

#include <revisit/descriptors/similarity.hpp>
#include <revisit/io/scan_file.hpp>
#include <revisit/preprocess/ground.hpp>
#include <revisit/preprocess/intensity.hpp>
#include <revisit/preprocess/range_filter.hpp>
#include <revisit/retrieval/place_index.hpp>
#include <revisit/verification/geometric.hpp>

int main(int argc, char** argv) {
  if (argc != 3) return std::puts("usage: example_each_stage EARLIER LATER"), 2;
  const revisit::Parameters parameters;
  std::vector<revisit::IntensityScanContext> descriptors;
  std::vector<revisit::ScanGeometry> geometries;
  revisit::PlaceIndex index(parameters.retrieval);

  for (int i = 0; i < 2; ++i) {
    auto scan = revisit::read_scan(argv[i + 1]);
    if (!scan) return std::puts(scan.error().message.c_str()), 1;
    revisit::filter_range(*scan, parameters.preprocess);
    const auto ground = revisit::segment_ground(*scan, revisit::find_rings(*scan), parameters.preprocess);
    const auto scale =
        revisit::estimate_intensity_scale(std::span<const revisit::Scan>(&*scan, 1), parameters.intensity);
    revisit::normalise_intensity(*scan, scale);
    descriptors.push_back(revisit::describe(scan->points, parameters.descriptor));
    geometries.emplace_back(revisit::thin(scan->points, ground.is_ground, parameters.geometric.voxel_m));
    std::printf("%s: %zu points, rings %s\n", argv[i + 1], scan->points.size(), to_string(ground.rings).c_str());
  }
  index.add(revisit::FrameId{0}, 0.0, descriptors[0]);
  const auto candidates = *index.search_all(descriptors[1]);
  std::printf("geometry %.3f, intensity %.3f, yaw %.0f degrees\n", candidates[0].geometry_score,
              candidates[0].intensity_score, revisit::to_degrees(candidates[0].yaw_rad));
  const auto evidence = revisit::check_geometric(
      geometries[0], geometries[1], {revisit::planar_pose(0, 0, candidates[0].yaw_rad)}, parameters.geometric);
  std::printf("inlier ratio %.2f, rmse %.3f m: %s\n", evidence.evidence.inlier_ratio, evidence.evidence.rmse_m,
              evidence.consistent ? "the same place" : evidence.reason.c_str());
}
