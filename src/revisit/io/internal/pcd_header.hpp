// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include <revisit/core/result.hpp>

namespace revisit::io_internal {

/// The header of a PCD file, checked against the size of the data that follow, so that PCL can be trusted with the
/// rest: it believes whatever a header says.
struct PcdHeader {
  struct Field {
    std::string name;
    std::size_t bytes = 0;  ///< of one element
    char type = 'F';        ///< F, I, U
    std::size_t count = 1;
  };
  std::vector<Field> fields;
  std::size_t width = 0, height = 0, points = 0;
  std::string viewpoint = "0 0 0 1 0 0 0", encoding;
  std::size_t data_offset = 0;  ///< first byte after the DATA line
  bool padding_was_repaired = false;

  std::size_t point_bytes() const;
  std::string text() const;  ///< a header that PCL reads
};

Result<PcdHeader> parse_pcd_header(const std::filesystem::path& file, std::string_view bytes);

}  // namespace revisit::io_internal
