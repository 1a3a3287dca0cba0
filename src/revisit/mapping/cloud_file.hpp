// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <fstream>
#include <span>

#include <revisit/core/result.hpp>
#include <revisit/core/scan.hpp>

namespace revisit {

enum class CloudFormat { kPly, kPcd };

/// Writes points with intensity, binary, part by part: a cloud may be larger than memory.
class CloudFile {
 public:
  /// The header tells how many points follow: add() exactly `count`.
  CloudFile(const std::filesystem::path& file, CloudFormat format, std::size_t count);
  void add(std::span<const Point> points);
  /// Everything is with the system when this returns without an error; the error names the file.
  Status finish();

 private:
  std::filesystem::path file_;
  std::ofstream stream_;
  std::size_t left_;
};

}  // namespace revisit
