// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include <revisit/config/parameters.hpp>
#include <revisit/core/scan.hpp>

namespace revisit::preprocess_internal {

/// Ground without rings: the lowest point of each cell of a polar grid, walked outward while the slope allows;
/// points little above the ground of their cell are ground.
std::vector<std::uint8_t> polar_ground(const Scan& scan, const PreprocessOptions& options);

}  // namespace revisit::preprocess_internal
