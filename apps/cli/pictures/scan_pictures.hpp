// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

#include <revisit/config/parameters.hpp>
#include <revisit/pipeline/prepare.hpp>

namespace revisit::cli {

/// The scan from above (ground pale, intensity as colour, the polar grid over it) and from the side, with its
/// descriptor.
Status draw_description(const std::filesystem::path& file, const PreparedScan& prepared, const Parameters& parameters,
                        const std::string& title);

}  // namespace revisit::cli
