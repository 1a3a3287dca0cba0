// SPDX-License-Identifier: Apache-2.0
#include <revisit/store/keyframe_bytes.hpp>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <memory>
#include <type_traits>
#include <utility>

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
constexpr std::size_t kMapPointBytes = 7, kChangeBytes = 5;
constexpr float kMost_cm = 32767.f, kIntensitySteps = 255.f;

// False where a point is too far out for its numbers.
bool put_map_point(Writer& writer, const Point& p) {
  const Eigen::Vector3f p_cm = 100.f * Eigen::Vector3f(p.x, p.y, p.z);
  if (p_cm.cwiseAbs().maxCoeff() > kMost_cm) return false;
  for (int axis = 0; axis < 3; ++axis) writer.put(static_cast<std::int16_t>(std::lround(p_cm[axis])));
  writer.put(static_cast<std::uint8_t>(std::lround(kIntensitySteps * std::clamp(p.intensity, 0.f, 1.f))));
  return true;
}

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
      !fits(descriptor.levels, 0) || !descriptor.is_consistent())
    return std::nullopt;
  return descriptor;
}

namespace {

void put(const ThinCloud& cloud, Writer& writer) {
  writer.put(cloud.voxel_m)
      .put(Position{cloud.up.x(), cloud.up.y(), cloud.up.z()})
      .put(static_cast<std::uint32_t>(cloud.points.size()));
  for (const Eigen::Vector3f& p : cloud.points) writer.put(Position{p.x(), p.y(), p.z()});
  writer.put_counted(cloud.is_ground).put_counted(cloud.intensity).put_counted(cloud.seen.ranges_cm());
}

std::optional<ThinCloud> get_thin_cloud(Reader& reader) {
  ThinCloud cloud;
  cloud.voxel_m = reader.get<float>();
  const auto up = reader.get<Position>();
  cloud.up = {up[0], up[1], up[2]};
  for (const Position& p : reader.get_counted<Position>()) cloud.points.emplace_back(p[0], p[1], p[2]);
  cloud.is_ground = reader.get_counted<std::uint8_t>();
  cloud.intensity = reader.get_counted<float>();
  auto seen = SeenSpace::from_ranges_cm(reader.get_counted<std::uint16_t>());
  const std::size_t count = cloud.points.size();
  if (!seen || cloud.is_ground.size() != count || cloud.intensity.size() != count || !(cloud.voxel_m > 0.f) ||
      !(std::abs(cloud.up.norm() - 1.f) < 1e-3f) ||
      !std::all_of(cloud.points.begin(), cloud.points.end(), [](const Eigen::Vector3f& p) { return p.allFinite(); }))
    return std::nullopt;
  cloud.seen = *std::move(seen);
  return cloud;
}

}  // namespace

// What was seen before follows it, where there is something.
Bytes to_bytes(const ThinCloud& cloud) {
  Writer writer;
  put(cloud, writer);
  if (cloud.before) put(*cloud.before, writer);
  return writer.take();
}

std::optional<ThinCloud> to_thin_cloud(std::span<const std::byte> bytes) {
  Reader reader(bytes);
  auto cloud = get_thin_cloud(reader);
  if (!cloud || reader.is_at_end()) return cloud;
  auto before = get_thin_cloud(reader);
  if (!before || !reader.is_at_end()) return std::nullopt;
  cloud->before = std::make_shared<const ThinCloud>(*std::move(before));
  return cloud;
}

Bytes to_map_bytes(const ThinCloud& cloud) {
  Writer writer;
  for (std::size_t i = 0; i < cloud.points.size(); ++i) {
    const Eigen::Vector3f& p = cloud.points[i];
    (void)put_map_point(writer, {p.x(), p.y(), p.z(), cloud.intensity[i]});
  }
  return writer.take();
}

Bytes to_map_bytes(std::span<const Point> points) {
  Writer writer;
  for (const Point& p : points) (void)put_map_point(writer, p);
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

Result<StoredPlacePoints> read_place_points(const MapStore& store, FrameId keyframe) {
  const auto cloud = store.part(keyframe, MapStore::Part::kCloud);
  if (!cloud) return cloud.error();
  auto points = to_map_points(*cloud);
  if (!points) return store.damaged("cloud", keyframe);
  StoredPlacePoints result{*std::move(points), {}, session_of(keyframe)};
  const auto changes = store.part(keyframe, MapStore::Part::kChanges);
  if (!changes) return changes.error();
  const auto own = static_cast<std::uint16_t>(session_of(keyframe));
  result.history.assign(result.points.size(), PointHistory{own, PointHistory::kNever, 0});
  if (changes->empty()) return result;
  if (changes->size() != sizeof(std::int32_t) + result.points.size() * kChangeBytes)
    return store.damaged("changes", keyframe);
  Reader reader(*changes);
  result.compared_with = reader.get<std::int32_t>();
  for (PointHistory& each : result.history) {
    each.since = reader.get<std::uint16_t>();
    each.gone = reader.get<std::uint16_t>();
    each.missed = reader.get<std::uint8_t>();
  }
  return result;
}

Status write_place_points(MapStore& store, FrameId keyframe, const StoredPlacePoints& points) {
  Writer cloud, changes;
  changes.put(static_cast<std::int32_t>(points.compared_with));
  for (std::size_t i = 0; i < points.points.size(); ++i) {
    if (!put_map_point(cloud, points.points[i])) continue;
    const PointHistory& history = points.history[i];
    changes.put(history.since);
    changes.put(history.gone);
    changes.put(history.missed);
  }
  return store.set_cloud(keyframe, cloud.take(), changes.take());
}

Result<std::vector<Point>> read_map_points(const MapStore& store, FrameId keyframe, std::optional<int> after_session) {
  auto all = read_place_points(store, keyframe);
  if (!all) return all.error();
  std::vector<Point> points;
  points.reserve(all->points.size());
  for (std::size_t i = 0; i < all->points.size(); ++i) {
    const PointHistory& history = all->history[i];
    if (after_session ? history.was_in_map(*after_session) : history.is_in_map()) points.push_back(all->points[i]);
  }
  return points;
}

}  // namespace revisit
