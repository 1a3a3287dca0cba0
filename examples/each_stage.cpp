// SPDX-License-Identifier: Apache-2.0
// The shipped method stage by stage, for those who want to exchange one: example_each_stage EARLIER LATER
// The last line compares it with register_scans(), which puts the same stages together.
#include <algorithm>
#include <cstdio>
#include <vector>

#include <revisit/descriptors/similarity.hpp>
#include <revisit/io/scan_file.hpp>
#include <revisit/pipeline/register_scans.hpp>
#include <revisit/preprocess/ground.hpp>
#include <revisit/preprocess/intensity.hpp>
#include <revisit/preprocess/range_filter.hpp>
#include <revisit/preprocess/rings.hpp>
#include <revisit/preprocess/upright.hpp>
#include <revisit/registration/overhead_search.hpp>
#include <revisit/retrieval/place_index.hpp>
#include <revisit/verification/geometric.hpp>

namespace {

struct Described {
  revisit::IntensityScanContext descriptor;
  revisit::ThinCloud cloud;
};

// Sections III-A and III-B of the paper, with the additions of docs/method.md.
Described describe(revisit::Scan scan, revisit::IntensityScaleLearner& scale, const revisit::Parameters& parameters) {
  revisit::filter_range(scan, parameters.preprocess);
  scale.add(scan);
  const revisit::Rings rings = revisit::find_rings(scan);
  const Eigen::Vector3f up = revisit::find_up(scan.points);
  revisit::rotate(scan.points, revisit::upright_pose(up));
  const auto ground = revisit::segment_ground(scan, rings, parameters.preprocess);
  revisit::normalise_intensity(scan, scale.scale());
  const double ground_z_m = revisit::ground_height_m(scan.points, ground.is_ground);
  Described described{revisit::describe(scan.points, parameters.descriptor, ground_z_m), {}};
  revisit::rotate(scan.points, revisit::upright_pose(up).inverse());
  described.cloud = revisit::thin_for_registration(scan.points, ground.is_ground);
  described.cloud.up = up;
  return described;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) return std::puts("usage: example_each_stage EARLIER LATER"), 2;
  const auto earlier = revisit::read_scan(argv[1]), later = revisit::read_scan(argv[2]);
  for (const auto* scan : {&earlier, &later})
    if (!*scan) return std::puts(scan->error().message.c_str()), 1;
  const revisit::Parameters parameters;
  revisit::IntensityScaleLearner scale(parameters.intensity);
  const Described place = describe(*earlier, scale, parameters), query = describe(*later, scale, parameters);

  // Section III-C: the index proposes candidates, each with a heading.
  revisit::PlaceIndex index(parameters.retrieval);
  index.add(revisit::FrameId{0}, 0.0, place.descriptor);
  const auto candidates = index.search(query.descriptor, index.size());
  if (!candidates || candidates->empty()) return std::puts("no candidate"), 1;
  const revisit::LoopCandidate& candidate = candidates->front();
  std::printf("retrieval: geometry %.3f, intensity %.3f, yaw %.0f degrees\n", candidate.geometry_score,
              candidate.intensity_score, revisit::to_degrees(candidate.yaw_rad));

  // Position and heading from overhead, both scans upright; then section III-D: registration and its evidence.
  revisit::OverheadSearch overhead(query.cloud);
  const auto seen = overhead.search(place.cloud, candidate.yaw_rad, revisit::kPi, 12.0).front();
  std::printf("overhead: (%.0f, %.0f) m, %.0f degrees, overlap %.2f\n", seen.x_m, seen.y_m,
              revisit::to_degrees(seen.yaw_rad), seen.overlap);
  const revisit::Pose T_guess = revisit::upright_pose(place.cloud.up).inverse() *
                                revisit::planar_pose(seen.x_m, seen.y_m, seen.yaw_rad) *
                                revisit::upright_pose(query.cloud.up);
  const revisit::ScanGeometry match(place.cloud), source(query.cloud);
  auto evidence = revisit::check_geometric(match, source, {T_guess, seen.overlap}, parameters.geometric);
  if (evidence.is_consistent()) revisit::refine(evidence, match, source);
  std::printf("registration: inlier ratio %.2f, rmse %.3f m, probability %.3f: %s\n", evidence.evidence.inlier_ratio,
              evidence.evidence.rmse_m, evidence.probability, evidence.is_consistent() ? "a loop" : "refused");

  const auto whole = revisit::register_scans(*later, *earlier, parameters);
  const bool is_same = whole && whole->is_accepted() == evidence.is_consistent() &&
                       whole->T_target_source.isApprox(evidence.T_match_query, 1e-9);
  std::puts(is_same ? "register_scans() says the same" : "register_scans() says something else");
  return is_same ? 0 : 1;
}
