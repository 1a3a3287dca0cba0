// SPDX-License-Identifier: Apache-2.0
#include <revisit/descriptors/internal/baselines.hpp>

namespace revisit {

std::unique_ptr<BaselineIndex> Baseline::make_index() const { return nullptr; }

std::vector<std::unique_ptr<Baseline>> make_baselines() {
  using namespace descriptors_internal;
  std::vector<std::unique_ptr<Baseline>> all;
  all.push_back(make_paper_isc());
  all.push_back(make_published_isc());
  all.push_back(make_scan_context(10));
  all.push_back(make_scan_context(0));
  all.push_back(make_scan_context_pp());
  all.push_back(make_m2dp());
  all.push_back(make_glarot3d());
  all.push_back(make_lidar_iris());
  all.push_back(make_landmark_density());
  all.push_back(make_ring());
  all.push_back(make_ring_pp());
  all.push_back(make_contour_context());
  all.push_back(make_stable_triangle());
  all.push_back(make_binary_triangle());
  all.push_back(make_solid());
  return all;
}

}  // namespace revisit
