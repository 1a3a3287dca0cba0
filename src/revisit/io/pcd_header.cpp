// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <charconv>
#include <cstdint>
#include <cstring>
#include <map>
#include <sstream>

#include <revisit/io/internal/bytes.hpp>
#include <revisit/io/internal/pcd_header.hpp>

namespace revisit::io_internal {
namespace {

using Words = std::vector<std::string_view>;

std::optional<std::size_t> parse_count(std::string_view word) {
  std::size_t value = 0;
  const auto [end, failure] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (failure != std::errc() || end != word.data() + word.size()) return std::nullopt;
  return value;
}

// A padding of count 0 means that the writer miscounted its padding (the sum is right, its parts are not). Such records
// are C structs: from there on each field stands at its natural alignment, and what is left pads the end.
void repair_padding(PcdHeader& header) {
  const auto is_zero_padding = [](const PcdHeader::Field& f) { return f.name == "_" && f.count == 0; };
  const auto first = std::find_if(header.fields.begin(), header.fields.end(), is_zero_padding);
  if (first == header.fields.end()) return;
  const std::size_t total = header.point_bytes();
  std::vector<PcdHeader::Field> repaired(header.fields.begin(), first);
  std::size_t offset = 0;
  for (const auto& field : repaired) offset += field.bytes * field.count;
  const auto pad_to = [&](std::size_t target) {
    if (target > offset) repaired.push_back({"_", 1, 'U', target - offset});
    offset = std::max(offset, target);
  };
  for (auto field = first; field != header.fields.end(); ++field) {
    if (field->name == "_") continue;
    pad_to((offset + field->bytes - 1) / field->bytes * field->bytes);
    repaired.push_back(*field);
    offset += field->bytes * field->count;
  }
  if (offset > total) return;
  pad_to(total);
  header.fields = std::move(repaired);
  header.padding_was_repaired = true;
}

// One row a point, each value a number: PCL reads whatever stands there as something.
Status check_ascii_rows(const std::filesystem::path& file, const PcdHeader& header, std::string_view data) {
  std::size_t values = 0, rows = 0;
  for (const auto& field : header.fields) values += field.count;
  if (header.points > data.size() / (2 * values) + 1)
    return Error{file.string() + ": truncated: " + std::to_string(header.points) + " points of " +
                 std::to_string(values) + " values declared, " + std::to_string(data.size()) + " bytes of text found"};
  for (std::string_view line : split_lines(data)) {
    if (rows == header.points) break;
    const auto numbers = parse_numbers(line);
    if (numbers && numbers->empty()) continue;
    ++rows;
    if (!numbers || numbers->size() != values)
      return Error{file.string() + ": point " + std::to_string(rows) + ": '" + std::string(line.substr(0, 60)) +
                   "' is no row of " + std::to_string(values) + " numbers"};
  }
  if (rows < header.points)
    return Error{file.string() + ": truncated: " + std::to_string(header.points) + " points declared, " +
                 std::to_string(rows) + " rows found"};
  return ok();
}

Status check_data(const std::filesystem::path& file, const PcdHeader& header, std::string_view data) {
  const std::string declared =
      std::to_string(header.points) + " points of " + std::to_string(header.point_bytes()) + " bytes declared";
  if (header.encoding == "binary") {
    if (data.size() / header.point_bytes() < header.points)
      return Error{file.string() + ": truncated: " + declared + ", data end after " +
                   std::to_string(data.size() / header.point_bytes()) + " points"};
    return ok();
  }
  if (header.encoding == "binary_compressed") {
    std::uint32_t sizes[2] = {0, 0};  // compressed, uncompressed
    if (data.size() < sizeof sizes) return Error{file.string() + ": truncated: no compressed data"};
    std::memcpy(sizes, data.data(), sizeof sizes);
    if (sizes[0] > data.size() - sizeof sizes)
      return Error{file.string() + ": truncated: " + std::to_string(sizes[0]) + " compressed bytes declared, " +
                   std::to_string(data.size() - sizeof sizes) + " found"};
    constexpr std::size_t kLargestRatio = 100;  // LZF makes at most 264 bytes of 3
    if (header.points > sizes[1] / header.point_bytes() || sizes[1] > kLargestRatio * (sizes[0] + std::size_t{1}))
      return Error{file.string() + ": " + declared + ", but " + std::to_string(sizes[0]) + " compressed bytes make " +
                   std::to_string(sizes[1])};
    return ok();
  }
  if (header.encoding == "ascii") {
    const auto raw = std::find_if(data.begin(), data.end(), [](char c) {
      return !(c >= ' ' && c <= '~') && c != '\n' && c != '\r' && c != '\t';
    });
    if (raw != data.end())
      return Error{file.string() + ": DATA ascii, but byte " +
                   std::to_string(header.data_offset + static_cast<std::size_t>(raw - data.begin())) +
                   " of the file is no text: malformed"};
    return check_ascii_rows(file, header, data);
  }
  return Error{file.string() + ": DATA " + header.encoding + " is unknown; allowed: ascii, binary, binary_compressed"};
}

}  // namespace

std::size_t PcdHeader::point_bytes() const {
  std::size_t sum = 0;
  for (const Field& field : fields) sum += field.bytes * field.count;
  return sum;
}

std::string PcdHeader::text() const {
  std::ostringstream names, sizes, types, counts;
  for (const Field& field : fields) {
    names << ' ' << field.name;
    sizes << ' ' << field.bytes;
    types << ' ' << field.type;
    counts << ' ' << field.count;
  }
  std::ostringstream header;
  header << "# .PCD v0.7\nVERSION 0.7\nFIELDS" << names.str() << "\nSIZE" << sizes.str() << "\nTYPE" << types.str()
         << "\nCOUNT" << counts.str() << "\nWIDTH " << width << "\nHEIGHT " << height << "\nVIEWPOINT " << viewpoint
         << "\nPOINTS " << points << "\nDATA " << encoding << "\n";
  return header.str();
}

Result<PcdHeader> parse_pcd_header(const std::filesystem::path& file, std::string_view bytes) {
  std::map<std::string, Words, std::less<>> rows;
  PcdHeader header;
  std::size_t offset = 0;
  constexpr std::size_t kLongestHeader = 1 << 16;
  while (rows.find("DATA") == rows.end()) {
    const auto end = bytes.substr(0, kLongestHeader).find('\n', offset);
    if (end == std::string_view::npos) return Error{file.string() + ": no PCD header (no DATA line)"};
    Words words = split_words(bytes.substr(offset, end - offset));
    offset = end + 1;
    if (words.empty() || words[0].front() == '#') continue;
    const std::string key(words[0]);
    words.erase(words.begin());
    rows[key] = std::move(words);
  }
  header.data_offset = offset;
  const auto wrong = [&](const std::string& what) { return Error{file.string() + ": PCD header: " + what}; };
  const auto single = [&](const char* key) -> std::optional<std::size_t> {
    return rows[key].size() == 1 ? parse_count(rows[key][0]) : std::nullopt;
  };
  for (const char* key : {"FIELDS", "SIZE", "TYPE"})
    if (rows[key].empty() || rows[key].size() != rows["FIELDS"].size())
      return wrong(std::string(key) + " has " + std::to_string(rows[key].size()) + " entries for " +
                   std::to_string(rows["FIELDS"].size()) + " fields");
  if (!rows["COUNT"].empty() && rows["COUNT"].size() != rows["FIELDS"].size())
    return wrong("COUNT has " + std::to_string(rows["COUNT"].size()) + " entries for " +
                 std::to_string(rows["FIELDS"].size()) + " fields");
  for (std::size_t i = 0; i < rows["FIELDS"].size(); ++i) {
    const auto size = parse_count(rows["SIZE"][i]);
    const auto count = rows["COUNT"].empty() ? std::optional<std::size_t>(1) : parse_count(rows["COUNT"][i]);
    const std::string_view type = rows["TYPE"][i], name = rows["FIELDS"][i];
    if (!size || (*size != 1 && *size != 2 && *size != 4 && *size != 8) || !count || *count > 100000 ||
        (type != "F" && type != "I" && type != "U") || (type == "F" && *size < 4) || (*count == 0 && name != "_"))
      return wrong("field '" + std::string(name) + "' has SIZE " + std::string(rows["SIZE"][i]) + ", TYPE " +
                   std::string(type) + ": not a field");
    header.fields.push_back({std::string(name), *size, type[0], *count});
  }
  const auto width = single("WIDTH"), height = single("HEIGHT"), points = single("POINTS");
  if (!width || !height) return wrong("WIDTH or HEIGHT is missing or no number");
  header.width = *width;
  header.height = *height;
  constexpr std::size_t kMostPoints = 100'000'000;
  if (*width > kMostPoints || *height > kMostPoints)
    return wrong("WIDTH " + std::to_string(*width) + ", HEIGHT " + std::to_string(*height) + ": larger than any scan");
  header.points = points.value_or(*width * *height);
  if (header.points != *width * *height || header.points == 0 || header.points > kMostPoints)
    return wrong("WIDTH " + std::to_string(*width) + " x HEIGHT " + std::to_string(*height) + " is not POINTS " +
                 std::to_string(header.points) + ", or there are none");
  header.encoding = rows["DATA"].empty() ? "" : std::string(rows["DATA"][0]);
  repair_padding(header);
  if (header.point_bytes() == 0) return wrong("records of 0 bytes");
  if (const Status status = check_data(file, header, bytes.substr(offset)); !status) return status.error();
  return header;
}

}  // namespace revisit::io_internal
