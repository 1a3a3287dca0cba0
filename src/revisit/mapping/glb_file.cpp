// SPDX-License-Identifier: Apache-2.0
#include <revisit/mapping/internal/glb_file.hpp>

#include <algorithm>
#include <array>
#include <bit>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <fstream>
#include <string>
#include <vector>

#include <revisit/core/text.hpp>

namespace revisit::mapping_internal {
namespace {

static_assert(std::endian::native == std::endian::little, "points are written as they lie in memory");

constexpr double kSteps = 65535.0;

// As it lies in the file; glTF wants attributes to begin at multiples of four bytes.
struct Row {
  std::array<std::uint16_t, 4> position{};  // the fourth is a gap
  std::uint8_t intensity = 0, session = 0;
  std::uint16_t time = 0;
};
static_assert(sizeof(Row) == 12);

std::string head(std::size_t count, const std::array<std::uint16_t, 3>& least, const std::array<std::uint16_t, 3>& most,
                 const Eigen::Vector3d& low, double edge_m) {
  const std::size_t bytes = count * sizeof(Row);
  const double scale = edge_m / kSteps;
  std::string text = R"({"asset":{"version":"2.0","generator":"revisit"},"extensionsUsed":["KHR_mesh_quantization"],)"
                     R"("extensionsRequired":["KHR_mesh_quantization"],"scene":0,"scenes":[{"nodes":[0]}],)"
                     R"("meshes":[{"primitives":[{"mode":0,"attributes":{"POSITION":0,"_INTENSITY":1,"_LABELS":2}}]}],)"
                     R"("nodes":[{"mesh":0,"rotation":[-0.70710678118654752,0,0,0.70710678118654752],)";
  text += format(R"("translation":[%.9g,%.9g,%.9g],"scale":[%.12g,%.12g,%.12g]}],)", low.x(), low.z(), -low.y(), scale,
                 scale, scale);
  text += format(R"("buffers":[{"byteLength":%zu}],"bufferViews":[{"buffer":0,"byteLength":%zu,)", bytes, bytes);
  text += R"("byteStride":12,"target":34962}],"accessors":[{"bufferView":0,"componentType":5123,"type":"VEC3",)";
  text += format(R"("count":%zu,"min":[%d,%d,%d],"max":[%d,%d,%d]},)", count, int{least[0]}, int{least[1]},
                 int{least[2]}, int{most[0]}, int{most[1]}, int{most[2]});
  text += R"({"bufferView":0,"byteOffset":8,"componentType":5121,"normalized":true,"type":"SCALAR",)";
  text += format(R"("count":%zu},)", count);
  text += R"({"bufferView":0,"byteOffset":8,"componentType":5121,"type":"VEC4",)";
  text += format(R"("count":%zu}]})", count);
  text.resize((text.size() + 3) / 4 * 4, ' ');
  return text;
}

void write_word(std::ofstream& stream, std::size_t value) {
  const auto word = static_cast<std::uint32_t>(value);
  stream.write(reinterpret_cast<const char*>(&word), sizeof word);
}

}  // namespace

Status write_glb(const std::filesystem::path& file, std::span<const MapPoint> points, const Eigen::Vector3d& low,
                 double edge_m) {
  constexpr std::uint32_t kMagic = 0x46546C67, kJson = 0x4E4F534A, kBinary = 0x004E4942;
  std::vector<Row> rows(points.size());
  std::array<std::uint16_t, 3> least{65535, 65535, 65535}, most{};
  const auto step = [&](float value, Eigen::Index axis) {
    const double steps = std::round((static_cast<double>(value) - low[axis]) * (kSteps / edge_m));
    return static_cast<std::uint16_t>(std::clamp(steps, 0.0, kSteps));
  };
  for (std::size_t i = 0; i < points.size(); ++i) {
    const MapPoint& p = points[i];
    Row& row = rows[i];
    row.position = {step(p.x, 0), step(p.y, 1), step(p.z, 2)};
    row.intensity = static_cast<std::uint8_t>(std::lround(255.f * std::clamp(p.intensity, 0.f, 1.f)));
    row.session = static_cast<std::uint8_t>(std::min<std::uint16_t>(p.session, 255));
    row.time = p.time;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      least[axis] = std::min(least[axis], row.position[axis]);
      most[axis] = std::max(most[axis], row.position[axis]);
    }
  }
  const std::string json = head(points.size(), least, most, low, edge_m);
  const std::size_t bytes = rows.size() * sizeof(Row);
  std::ofstream stream(file, std::ios::binary | std::ios::trunc);
  for (const std::size_t word :
       {std::size_t{kMagic}, std::size_t{2}, 28 + json.size() + bytes, json.size(), std::size_t{kJson}})
    write_word(stream, word);
  stream << json;
  write_word(stream, bytes);
  write_word(stream, kBinary);
  stream.write(reinterpret_cast<const char*>(rows.data()), static_cast<std::streamsize>(bytes));
  stream.close();
  return stream ? ok() : Status(Error{file.string() + ": cannot be written: " + std::strerror(errno)});
}

}  // namespace revisit::mapping_internal
