// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <revisit/core/result.hpp>

namespace revisit::io_internal {

/// The whole file, or an error with the system's reason. Files above 2 GiB are refused: no scan is that large.
Result<std::string> read_bytes(const std::filesystem::path& file);

/// Rows of white-space separated numbers; '#' starts a comment, empty rows are skipped.
struct NumberRow {
  std::size_t line = 0;  ///< 1-based
  std::vector<double> values;
};
Result<std::vector<NumberRow>> read_number_rows(const std::filesystem::path& file);

/// The numbers of one line; nothing where a word is no number. "nan" and "inf" are numbers.
std::optional<std::vector<double>> parse_numbers(std::string_view line);

std::vector<std::string_view> split_lines(std::string_view text);
std::vector<std::string_view> split_words(std::string_view line);

/// The system's text for errno, e.g. "Permission denied".
std::string system_reason();

}  // namespace revisit::io_internal
