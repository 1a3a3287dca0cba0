// SPDX-License-Identifier: Apache-2.0
#include "view/view_files.hpp"

#include <fstream>
#include <iterator>
#include <system_error>

#include <nlohmann/json.hpp>

namespace revisit::cli {
namespace fs = std::filesystem;

std::optional<std::string> read_tile(const fs::path& folder, const std::string& name) {
  std::error_code failure;
  const fs::path root = fs::canonical(folder, failure);
  if (failure) return std::nullopt;
  const fs::path file = fs::canonical(root / name, failure);
  if (failure || file.parent_path() != root || !fs::is_regular_file(file, failure)) return std::nullopt;
  std::ifstream stream(file, std::ios::binary);
  if (!stream) return std::nullopt;
  return std::string{std::istreambuf_iterator<char>(stream), {}};
}

std::string bytes_of_points(std::span<const Point> points) {
  return {reinterpret_cast<const char*>(points.data()), points.size() * sizeof(Point)};
}

std::string to_json(const IntensityScanContext& descriptor) {
  nlohmann::json rows = {
      {"rings", descriptor.rings}, {"sectors", descriptor.sectors}, {"intensity", descriptor.intensity}};
  auto& occupied = rows["occupied"] = nlohmann::json::array();
  for (int sector = 0; sector < descriptor.sectors; ++sector)
    for (int ring = 0; ring < descriptor.rings; ++ring) occupied.push_back(descriptor.occupied(ring, sector) ? 1 : 0);
  return rows.dump();
}

}  // namespace revisit::cli
