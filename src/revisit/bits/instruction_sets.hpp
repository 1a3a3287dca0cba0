// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace revisit {

/// The instruction sets that this processor can run, as Highway's target bits, for tests that force each; while one is
/// forced, that one alone.
std::vector<std::int64_t> supported_instruction_sets();
/// Forces one for everything that chooses at run time; 0 returns to the best. Not while other threads compute.
void force_instruction_set(std::int64_t target);
/// Highway's name of the one that is chosen.
const char* instruction_set_name();
/// How many lanes of 64 bits its vectors have, as the running code has it.
std::size_t instruction_set_lanes();

}  // namespace revisit
