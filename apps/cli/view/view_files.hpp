// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <span>
#include <string>

#include <revisit/core/scan.hpp>
#include <revisit/descriptors/intensity_scan_context.hpp>

namespace revisit::cli {

/// A file of the tileset in `folder`, and no other, wherever links may lead; absent where it is not there.
std::optional<std::string> read_tile(const std::filesystem::path& folder, const std::string& name);
/// scans/N.bin (docs/formats.md, "View").
std::string bytes_of_points(std::span<const Point> points);
/// descriptors/N.json.
std::string to_json(const IntensityScanContext& descriptor);

}  // namespace revisit::cli
