// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <revisit/descriptors/baseline.hpp>

namespace revisit::descriptors_internal {

std::unique_ptr<Baseline> make_paper_isc();
std::unique_ptr<Baseline> make_published_isc();
std::unique_ptr<Baseline> make_scan_context(std::size_t nearest_ring_keys);  ///< 0: every place is compared
std::unique_ptr<Baseline> make_scan_context_pp();
std::unique_ptr<Baseline> make_m2dp();
std::unique_ptr<Baseline> make_glarot3d();
std::unique_ptr<Baseline> make_lidar_iris();
std::unique_ptr<Baseline> make_ring();
std::unique_ptr<Baseline> make_solid();

}  // namespace revisit::descriptors_internal
