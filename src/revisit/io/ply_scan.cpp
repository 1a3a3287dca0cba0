// SPDX-License-Identifier: Apache-2.0
#include <charconv>
#include <map>

#include <pcl/io/ply_io.h>

#include <revisit/io/internal/bytes.hpp>
#include <revisit/io/internal/scan_formats.hpp>

namespace revisit::io_internal {
namespace {

const std::map<std::string_view, std::size_t> kTypeBytes = {
    {"char", 1},   {"int8", 1},    {"uchar", 1},  {"uint8", 1},  {"short", 2}, {"int16", 2},
    {"ushort", 2}, {"uint16", 2},  {"int", 4},    {"int32", 4},  {"uint", 4},  {"uint32", 4},
    {"float", 4},  {"float32", 4}, {"double", 8}, {"float64", 8}};

// PCL reserves what the header declares: make sure that the file can hold it.
Status check_header(const std::filesystem::path& file, std::string_view bytes) {
  const auto wrong = [&](const std::string& what) { return Error{file.string() + ": PLY header: " + what}; };
  const auto end = bytes.find("end_header");
  if (bytes.substr(0, 3) != "ply" || end == std::string_view::npos) return wrong("not found");
  bool ascii = false, in_vertex = false;
  std::size_t vertices = 0, vertex_bytes = 0;
  for (std::string_view line : split_lines(bytes.substr(0, end))) {
    const auto words = split_words(line);
    if (words.empty()) continue;
    if (words[0] == "format") ascii = words.size() > 1 && words[1] == "ascii";
    if (words[0] == "element") {
      in_vertex = words.size() == 3 && words[1] == "vertex";
      if (in_vertex) {
        const auto [stop, failure] = std::from_chars(words[2].data(), words[2].data() + words[2].size(), vertices);
        if (failure != std::errc() || stop != words[2].data() + words[2].size())
          return wrong("'" + std::string(line) + "' gives no number of vertices");
      }
    }
    if (words[0] == "property" && in_vertex) {
      const auto type = words.size() == 3 ? kTypeBytes.find(words[1]) : kTypeBytes.end();
      if (type == kTypeBytes.end()) return wrong("'" + std::string(line) + "' is no property of a point");
      vertex_bytes += ascii ? 2 : type->second;
    }
  }
  if (vertices == 0 || vertex_bytes == 0) return wrong("no vertices");
  const std::size_t data_bytes = bytes.size() - end;
  if (vertices > data_bytes / vertex_bytes)
    return Error{file.string() + ": truncated: " + std::to_string(vertices) + " points declared, " +
                 std::to_string(data_bytes) + " bytes of data found"};
  return ok();
}

}  // namespace

Result<Scan> read_ply(const std::filesystem::path& file, const LogSink& log) {
  silence_pcl();
  const auto bytes = read_bytes(file);
  if (!bytes) return bytes.error();
  if (bytes->empty()) return Error{file.string() + ": empty file"};
  if (const Status status = check_header(file, *bytes); !status) return status.error();
  pcl::PCLPointCloud2 cloud;
  Eigen::Vector4f origin;
  Eigen::Quaternionf orientation;
  int version = 0;
  if (pcl::PLYReader().read(file.string(), cloud, origin, orientation, version) < 0)
    return Error{file.string() + ": the data do not match the PLY header"};
  return to_scan(file, cloud, log);
}

}  // namespace revisit::io_internal
