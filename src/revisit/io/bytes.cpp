// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <fstream>

#include <revisit/io/internal/bytes.hpp>

namespace revisit::io_internal {

std::string system_reason() { return errno != 0 ? std::strerror(errno) : "input/output error"; }

Result<std::string> read_bytes(const std::filesystem::path& file) {
  std::error_code failure;
  if (std::filesystem::is_directory(file, failure)) return Error{file.string() + ": is a folder, not a file"};
  errno = 0;
  std::ifstream stream(file, std::ios::binary | std::ios::ate);
  if (!stream) return Error{file.string() + ": cannot be opened: " + system_reason()};
  const auto size = static_cast<std::streamoff>(stream.tellg());
  constexpr std::streamoff kLargest = std::streamoff{1} << 31;
  if (size < 0 || size > kLargest)
    return Error{file.string() + ": " + std::to_string(size) + " bytes; allowed: up to " + std::to_string(kLargest)};
  std::string bytes(static_cast<std::size_t>(size), '\0');
  stream.seekg(0);
  if (!stream.read(bytes.data(), size)) return Error{file.string() + ": cannot be read: " + system_reason()};
  return bytes;
}

std::vector<std::string_view> split_lines(std::string_view text) {
  std::vector<std::string_view> lines;
  while (!text.empty()) {
    const auto end = text.find('\n');
    std::string_view line = text.substr(0, end);
    if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
    lines.push_back(line);
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
  }
  return lines;
}

std::vector<std::string_view> split_words(std::string_view line) {
  constexpr std::string_view kSpace = " \t\r";
  std::vector<std::string_view> words;
  for (auto begin = line.find_first_not_of(kSpace); begin != std::string_view::npos;) {
    const auto end = std::min(line.find_first_of(kSpace, begin), line.size());
    words.push_back(line.substr(begin, end - begin));
    begin = line.find_first_not_of(kSpace, end);
  }
  return words;
}

std::optional<std::vector<double>> parse_numbers(std::string_view line) {
  std::vector<double> values;
  for (std::string_view word : split_words(line)) {
    if (word.front() == '+') word.remove_prefix(1);
    double value = 0.0;
    const auto [end, failure] = std::from_chars(word.data(), word.data() + word.size(), value);
    if (failure != std::errc() || end != word.data() + word.size()) return std::nullopt;
    values.push_back(value);
  }
  return values;
}

Result<std::vector<NumberRow>> read_number_rows(const std::filesystem::path& file) {
  const auto text = read_bytes(file);
  if (!text) return text.error();
  std::vector<NumberRow> rows;
  std::size_t number = 0;
  for (std::string_view line : split_lines(*text)) {
    ++number;
    line = line.substr(0, line.find('#'));
    if (line.find_first_not_of(" \t\r") == std::string_view::npos) continue;
    auto values = parse_numbers(line);
    if (!values) {
      std::string excerpt(line.substr(0, 40));
      std::replace_if(
          excerpt.begin(), excerpt.end(), [](char c) { return c < ' ' || c > '~'; }, '?');
      return Error{file.string() + ":" + std::to_string(number) + ": '" + excerpt + "' is not a row of numbers"};
    }
    rows.push_back({number, std::move(*values)});
  }
  return rows;
}

}  // namespace revisit::io_internal
