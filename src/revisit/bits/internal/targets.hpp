// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace revisit::bits_internal {

/// Highway's instruction sets that are compiled in and run on this processor, one bit each.
std::vector<std::int64_t> supported_targets();
/// Runs one of them until called again; 0: the best. For tests.
void force_target(std::int64_t target);
const char* current_target_name();

/// How many lanes of 64 bits the instruction set that runs works on: asked of the running code itself.
std::size_t running_lanes();

}  // namespace revisit::bits_internal
