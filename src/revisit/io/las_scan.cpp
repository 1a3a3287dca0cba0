// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cmath>
#include <optional>

#include <revisit/core/text.hpp>
#include <revisit/io/internal/byte_cursor.hpp>
#include <revisit/io/internal/bytes.hpp>
#include <revisit/io/internal/scan_formats.hpp>

namespace revisit::io_internal {
namespace {

// ASPRS LAS 1.0 to 1.4, public header block; the places of its values.
constexpr std::size_t kHeadBytes = 227, kLargeCountHeadBytes = 375;
constexpr std::size_t kMinorAt = 25, kDataOffsetAt = 96, kFormatAt = 104, kRecordBytesAt = 105, kCountAt = 107,
                      kScaleAt = 131, kOffsetAt = 155, kLargeCountAt = 247;
constexpr std::array<std::size_t, 11> kLeastRecordBytes{20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67};

struct LasHead {
  std::size_t data = 0, record_bytes = 0;
  std::uint64_t points = 0;
  Eigen::Vector3d scale, offset;
};

Result<LasHead> parse_head(const std::filesystem::path& file, ByteSpan bytes) {
  const auto wrong = [&](const std::string& reason) { return Error{file.string() + ": LAS header: " + reason}; };
  if (bytes.size() < kHeadBytes || !std::equal(bytes.begin(), bytes.begin() + 4, "LASF")) return wrong("is none");
  const auto at = [&]<typename T>(T, std::size_t offset) { return load_number<T>(bytes.data() + offset); };
  LasHead head;
  head.data = at(std::uint32_t{}, kDataOffsetAt);
  head.record_bytes = at(std::uint16_t{}, kRecordBytesAt);
  head.points = at(std::uint32_t{}, kCountAt);
  const std::uint8_t format = bytes[kFormatAt];
  if ((format & 0xC0) != 0) return wrong("the points are compressed (LAZ); `laszip -i FILE -o FILE.las` unpacks them");
  if (format >= kLeastRecordBytes.size()) return wrong("point format " + std::to_string(format) + "; allowed: 0 to 10");
  if (head.points == 0 && bytes[kMinorAt] >= 4 && bytes.size() >= kLargeCountHeadBytes)
    head.points = at(std::uint64_t{}, kLargeCountAt);
  if (head.record_bytes < kLeastRecordBytes[format])
    return wrong(std::to_string(head.record_bytes) + " bytes a point; format " + std::to_string(format) + " needs " +
                 std::to_string(kLeastRecordBytes[format]));
  if (head.data > bytes.size() || head.points > (bytes.size() - head.data) / head.record_bytes)
    return wrong(std::to_string(head.points) + " points declared, " + std::to_string(bytes.size()) +
                 " bytes in the file");
  for (int axis = 0; axis < 3; ++axis) {
    head.scale[axis] = at(double{}, kScaleAt + 8u * static_cast<std::size_t>(axis));
    head.offset[axis] = at(double{}, kOffsetAt + 8u * static_cast<std::size_t>(axis));
  }
  if (!head.scale.allFinite() || !head.offset.allFinite() || head.scale.minCoeff() <= 0.0)
    return wrong("its scale or offset is no number");
  return head;
}

}  // namespace

Result<Scan> read_las(const std::filesystem::path& file, const LogSink& log) {
  const auto text = read_bytes(file);
  if (!text) return text.error();
  if (text->empty()) return Error{file.string() + ": empty file"};
  const ByteSpan bytes(reinterpret_cast<const std::uint8_t*>(text->data()), text->size());
  const auto head = parse_head(file, bytes);
  if (!head) return head.error();
  // Coordinates on the Earth are too large for float32: they are counted from the first point, in whole metres.
  constexpr double kFar_m = 10'000.0;
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  Scan scan;
  scan.points.reserve(head->points);
  for (std::uint64_t i = 0; i < head->points; ++i) {
    const std::uint8_t* record = bytes.data() + head->data + i * head->record_bytes;
    const Eigen::Vector3d p =
        head->offset + head->scale.cwiseProduct(Eigen::Vector3d(load_number<std::int32_t>(record),
                                                                load_number<std::int32_t>(record + 4),
                                                                load_number<std::int32_t>(record + 8)));
    if (i == 0 && p.cwiseAbs().maxCoeff() > kFar_m) {
      origin = p.array().floor();
      log_to(log, LogLevel::kInfo,
             file.string() +
                 format(": coordinates are counted from (%.0f, %.0f, %.0f)", origin.x(), origin.y(), origin.z()));
    }
    const Eigen::Vector3f q = (p - origin).cast<float>();
    append_point(scan, {q.x(), q.y(), q.z(), static_cast<float>(load_number<std::uint16_t>(record + 12))});
  }
  return scan;
}

}  // namespace revisit::io_internal
