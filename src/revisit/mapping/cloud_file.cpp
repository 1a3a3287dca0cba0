// SPDX-License-Identifier: Apache-2.0
#include <revisit/mapping/cloud_file.hpp>

#include <algorithm>
#include <array>
#include <cassert>
#include <cerrno>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

namespace revisit {
namespace {

// ASPRS LAS 1.4, point format 6: the places of what is not zero.
struct Las {
  static constexpr std::size_t kHeadBytes = 375, kPointBytes = 30, kRecordHeadBytes = 54;
  static constexpr std::uint16_t kTextOfProjection = 2112, kProjectionIsText = 1 << 4;
  static constexpr double kScale_m = 0.001;
  static constexpr float kFullIntensity = 65535.f;
};

template <typename Value>
void put(std::span<char> bytes, std::size_t at, Value value) {
  std::memcpy(bytes.data() + at, &value, sizeof value);
}

// A UTM zone as OGC's well-known text; its number is the EPSG's, 326 or 327 and the zone.
std::string utm_text(int epsg) {
  const int zone = epsg % 100;
  const bool is_south = epsg / 100 == 327;
  return "PROJCS[\"WGS 84 / UTM zone " + std::to_string(zone) + (is_south ? "S" : "N") +
         "\",GEOGCS[\"WGS 84\",DATUM[\"WGS_1984\",SPHEROID[\"WGS 84\",6378137,298.257223563]],"
         "PRIMEM[\"Greenwich\",0],UNIT[\"degree\",0.0174532925199433],AUTHORITY[\"EPSG\",\"4326\"]],"
         "PROJECTION[\"Transverse_Mercator\"],PARAMETER[\"latitude_of_origin\",0],PARAMETER[\"central_meridian\"," +
         std::to_string(6 * zone - 183) +
         "],PARAMETER[\"scale_factor\",0.9996],PARAMETER[\"false_easting\",500000],PARAMETER[\"false_northing\"," +
         (is_south ? "10000000" : "0") +
         "],UNIT[\"metre\",1],AXIS[\"Easting\",EAST],AXIS[\"Northing\",NORTH],AUTHORITY[\"EPSG\",\"" +
         std::to_string(epsg) + "\"]]";
}

}  // namespace

CloudFile::CloudFile(const std::filesystem::path& file, CloudFormat format, std::size_t count,
                     const Eigen::Vector3d& las_offset_m, int las_epsg)
    : file_(file),
      format_(format),
      stream_(file, std::ios::binary | std::ios::trunc),
      count_(count),
      left_(count),
      las_offset_m_(las_offset_m),
      las_epsg_(las_epsg) {
  write_head();
}

void CloudFile::write_head() {
  if (format_ == CloudFormat::kPly) {
    stream_ << "ply\nformat binary_little_endian 1.0\ncomment metres; intensity in [0, 1]\nelement vertex " << count_
            << "\nproperty float x\nproperty float y\nproperty float z\nproperty float intensity\nend_header\n";
  } else if (format_ == CloudFormat::kPcd) {
    stream_ << "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS x y z intensity\nSIZE 4 4 4 4\n"
               "TYPE F F F F\nCOUNT 1 1 1 1\nWIDTH "
            << count_ << "\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS " << count_ << "\nDATA binary\n";
  } else {
    std::array<char, Las::kHeadBytes> head{};
    std::memcpy(head.data(), "LASF", 4);
    put(head, 24, std::uint8_t{1});
    put(head, 6, Las::kProjectionIsText);
    put(head, 25, std::uint8_t{4});
    std::memcpy(head.data() + 58, "revisit", 7);
    put(head, 94, static_cast<std::uint16_t>(Las::kHeadBytes));
    const std::string projection = las_epsg_ == 0 ? "" : utm_text(las_epsg_) + '\0';
    const std::size_t record_bytes = las_epsg_ == 0 ? 0 : Las::kRecordHeadBytes + projection.size();
    put(head, 96, static_cast<std::uint32_t>(Las::kHeadBytes + record_bytes));
    put(head, 100, std::uint32_t{las_epsg_ == 0 ? 0u : 1u});
    put(head, 104, std::uint8_t{6});
    put(head, 105, static_cast<std::uint16_t>(Las::kPointBytes));
    put(head, 247, static_cast<std::uint64_t>(count_));
    put(head, 255, static_cast<std::uint64_t>(count_));  // all are first returns
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto i = static_cast<Eigen::Index>(axis);
      put(head, 131 + 8 * axis, Las::kScale_m);
      put(head, 155 + 8 * axis, las_offset_m_[i]);
      put(head, 179 + 16 * axis, highest_[i] + las_offset_m_[i]);
      put(head, 187 + 16 * axis, lowest_[i] + las_offset_m_[i]);
    }
    stream_.write(head.data(), head.size());
    if (las_epsg_ == 0) return;
    std::array<char, Las::kRecordHeadBytes> record{};
    std::memcpy(record.data() + 2, "LASF_Projection", 15);
    put(record, 18, Las::kTextOfProjection);
    put(record, 20, static_cast<std::uint16_t>(projection.size()));
    stream_.write(record.data(), record.size());
    stream_ << projection;
  }
}

void CloudFile::write_las_points(std::span<const Point> points) {
  std::vector<char> bytes(points.size() * Las::kPointBytes);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Point& p = points[i];
    const std::span<char> row(bytes.data() + i * Las::kPointBytes, Las::kPointBytes);
    const Eigen::Vector3d position =
        Las::kScale_m * (Eigen::Vector3f(p.x, p.y, p.z).cast<double>() / Las::kScale_m).array().round();
    const bool is_first = left_ == count_ && i == 0;
    lowest_ = is_first ? position : lowest_.cwiseMin(position);
    highest_ = is_first ? position : highest_.cwiseMax(position);
    for (std::size_t axis = 0; axis < 3; ++axis)
      put(row, 4 * axis,
          static_cast<std::int32_t>(std::lround(position[static_cast<Eigen::Index>(axis)] / Las::kScale_m)));
    put(row, 12, static_cast<std::uint16_t>(std::lround(Las::kFullIntensity * std::clamp(p.intensity, 0.f, 1.f))));
    put(row, 14, std::uint8_t{0x11});  // the first return of one
  }
  stream_.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
}

void CloudFile::add(std::span<const Point> points) {
  assert(points.size() <= left_);
  if (format_ == CloudFormat::kLas)
    write_las_points(points);
  else
    stream_.write(reinterpret_cast<const char*>(points.data()), static_cast<std::streamsize>(points.size_bytes()));
  left_ -= points.size();
}

Status CloudFile::finish() {
  assert(left_ == 0);
  if (format_ == CloudFormat::kLas) {  // its bounds are known by now
    stream_.seekp(0);
    write_head();
  }
  stream_.close();
  if (stream_) return ok();
  return Error{file_.string() + ": cannot be written: " + std::strerror(errno)};
}

Status read_back(const std::filesystem::path& ply, const std::function<void(std::span<const Point>)>& take) {
  constexpr int kMostLines = 20;
  constexpr std::size_t kPart = 1 << 16;
  std::ifstream stream(ply, std::ios::binary);
  std::string line;
  for (int i = 0; line != "end_header"; ++i)
    if (i == kMostLines || !std::getline(stream, line)) return Error{ply.string() + ": is no map that slam wrote"};
  std::vector<Point> points(kPart);
  while (stream) {
    stream.read(reinterpret_cast<char*>(points.data()), static_cast<std::streamsize>(kPart * sizeof(Point)));
    take(std::span(points).first(static_cast<std::size_t>(stream.gcount()) / sizeof(Point)));
  }
  return ok();
}

}  // namespace revisit
