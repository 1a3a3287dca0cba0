// SPDX-License-Identifier: Apache-2.0
#include <revisit/store/keyframe_bytes.hpp>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <type_traits>

namespace revisit {
namespace {

static_assert(std::endian::native == std::endian::little, "the bytes of a map are little-endian");

class Writer {
 public:
  template <typename T>
  Writer& put(const T& value) {
    return put_all(std::span<const T>(&value, 1));
  }
  template <typename T>
  Writer& put_all(std::span<const T> values) {
    static_assert(std::is_trivially_copyable_v<T>);
    const auto bytes = std::as_bytes(values);
    bytes_.insert(bytes_.end(), bytes.begin(), bytes.end());
    return *this;
  }
  template <typename T>
  Writer& put_counted(const std::vector<T>& values) {
    return put(static_cast<std::uint32_t>(values.size())).put_all(std::span<const T>(values));
  }
  Bytes take() { return std::move(bytes_); }

 private:
  Bytes bytes_;
};

// Reads what Writer wrote; a step too far leaves it in failure.
class Reader {
 public:
  explicit Reader(std::span<const std::byte> bytes) : bytes_(bytes) {}
  template <typename T>
  T get() {
    T value{};
    if (const auto from = take(sizeof value); !from.empty()) std::memcpy(&value, from.data(), sizeof value);
    return value;
  }
  template <typename T>
  std::vector<T> get_counted() {
    const auto count = get<std::uint32_t>();
    const auto from = take(std::size_t{count} * sizeof(T));
    std::vector<T> values(from.size() / sizeof(T));
    if (!values.empty()) std::memcpy(values.data(), from.data(), from.size());
    return values;
  }
  bool is_at_end() const { return is_fine_ && bytes_.empty(); }

 private:
  std::span<const std::byte> take(std::size_t count) {
    is_fine_ = is_fine_ && count <= bytes_.size();
    if (!is_fine_) return {};
    const auto taken = bytes_.first(count);
    bytes_ = bytes_.subspan(count);
    return taken;
  }
  std::span<const std::byte> bytes_;
  bool is_fine_ = true;
};

using Position = std::array<float, 3>;
constexpr std::size_t kMapPointBytes = 7;
constexpr float kMost_cm = 32767.f, kIntensitySteps = 255.f;

}  // namespace

Bytes to_bytes(const IntensityScanContext& descriptor) {
  return Writer()
      .put(std::int32_t{descriptor.rings})
      .put(std::int32_t{descriptor.sectors})
      .put(std::int32_t{descriptor.levels})
      .put_counted(descriptor.intensity)
      .put_counted(descriptor.occupancy)
      .take();
}

std::optional<IntensityScanContext> to_descriptor(std::span<const std::byte> bytes) {
  Reader reader(bytes);
  IntensityScanContext descriptor;
  descriptor.rings = reader.get<std::int32_t>();
  descriptor.sectors = reader.get<std::int32_t>();
  descriptor.levels = reader.get<std::int32_t>();
  descriptor.intensity = reader.get_counted<std::uint8_t>();
  descriptor.occupancy = reader.get_counted<std::uint64_t>();
  constexpr int kMost = 720;
  const auto fits = [](int value, int least) { return value >= least && value <= kMost; };
  if (!reader.is_at_end() || !fits(descriptor.rings, 1) || !fits(descriptor.sectors, 1) ||
      !fits(descriptor.levels, 0) ||
      descriptor.cells() != static_cast<std::size_t>(descriptor.rings) * static_cast<std::size_t>(descriptor.sectors) ||
      descriptor.occupancy.size() != (descriptor.image_cells() + 63) / 64)
    return std::nullopt;
  return descriptor;
}

Bytes to_bytes(const ThinCloud& cloud) {
  Writer writer;
  writer.put(cloud.voxel_m)
      .put(Position{cloud.up.x(), cloud.up.y(), cloud.up.z()})
      .put(static_cast<std::uint32_t>(cloud.points.size()));
  for (const Eigen::Vector3f& p : cloud.points) writer.put(Position{p.x(), p.y(), p.z()});
  return writer.put_counted(cloud.is_ground).put_counted(cloud.intensity).put_counted(cloud.seen.ranges_cm()).take();
}

std::optional<ThinCloud> to_thin_cloud(std::span<const std::byte> bytes) {
  Reader reader(bytes);
  ThinCloud cloud;
  cloud.voxel_m = reader.get<float>();
  const auto up = reader.get<Position>();
  cloud.up = {up[0], up[1], up[2]};
  for (const Position& p : reader.get_counted<Position>()) cloud.points.emplace_back(p[0], p[1], p[2]);
  cloud.is_ground = reader.get_counted<std::uint8_t>();
  cloud.intensity = reader.get_counted<float>();
  auto seen = SeenSpace::from_ranges_cm(reader.get_counted<std::uint16_t>());
  const std::size_t count = cloud.points.size();
  if (!reader.is_at_end() || !seen || cloud.is_ground.size() != count || cloud.intensity.size() != count ||
      !(cloud.voxel_m > 0.f) || !(std::abs(cloud.up.norm() - 1.f) < 1e-3f) ||
      !std::all_of(cloud.points.begin(), cloud.points.end(), [](const Eigen::Vector3f& p) { return p.allFinite(); }))
    return std::nullopt;
  cloud.seen = *std::move(seen);
  return cloud;
}

Bytes to_map_bytes(const ThinCloud& cloud) {
  Writer writer;
  for (std::size_t i = 0; i < cloud.points.size(); ++i) {
    const Eigen::Vector3f p_cm = 100.f * cloud.points[i];
    if (p_cm.cwiseAbs().maxCoeff() > kMost_cm) continue;
    for (int axis = 0; axis < 3; ++axis) writer.put(static_cast<std::int16_t>(std::lround(p_cm[axis])));
    writer.put(static_cast<std::uint8_t>(std::lround(kIntensitySteps * std::clamp(cloud.intensity[i], 0.f, 1.f))));
  }
  return writer.take();
}

std::optional<std::vector<Point>> to_map_points(std::span<const std::byte> bytes) {
  if (bytes.size() % kMapPointBytes != 0) return std::nullopt;
  std::vector<Point> points(bytes.size() / kMapPointBytes);
  Reader reader(bytes);
  for (Point& p : points) {
    for (float* const axis : {&p.x, &p.y, &p.z}) *axis = 0.01f * static_cast<float>(reader.get<std::int16_t>());
    p.intensity = static_cast<float>(reader.get<std::uint8_t>()) / kIntensitySteps;
  }
  return points;
}

Result<std::vector<Point>> read_map_points(const MapStore& store, FrameId keyframe) {
  const auto bytes = store.part(keyframe, MapStore::Part::kCloud);
  if (!bytes) return bytes.error();
  auto points = to_map_points(*bytes);
  if (!points) return store.damaged("cloud", keyframe);
  return *std::move(points);
}

}  // namespace revisit
