// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <vector>

#include <revisit/core/point_history.hpp>
#include <revisit/core/scan.hpp>
#include <revisit/descriptors/intensity_scan_context.hpp>
#include <revisit/registration/surface_cloud.hpp>
#include <revisit/store/map_store.hpp>

namespace revisit {

/// What the store keeps of a key frame, as bytes (docs/formats.md). Reading gives nothing where the bytes are not what
/// was written: cut off, or with numbers that cannot be.
Bytes to_bytes(const IntensityScanContext& descriptor);
std::optional<IntensityScanContext> to_descriptor(std::span<const std::byte> bytes);

Bytes to_bytes(const ThinCloud& cloud);
std::optional<ThinCloud> to_thin_cloud(std::span<const std::byte> bytes);

/// A cloud for the map: positions to a centimetre (up to 327 m), intensity in 255 steps of [0, 1]; 7 bytes a point.
Bytes to_map_bytes(const ThinCloud& cloud);
Bytes to_map_bytes(std::span<const Point> points);
std::optional<std::vector<Point>> to_map_points(std::span<const std::byte> bytes);
/// Points with their histories, and the session that was compared with them last.
struct StoredPlacePoints {
  std::vector<Point> points;
  std::vector<PointHistory> history;
  int compared_with = 0;
};
/// Those of a key frame, in its frame, metres; none where the place was known already.
Result<StoredPlacePoints> read_place_points(const MapStore& store, FrameId keyframe);
Status write_place_points(MapStore& store, FrameId keyframe, const StoredPlacePoints& points);
/// The same without what is gone; or as the map was after a session of before.
Result<std::vector<Point>> read_map_points(const MapStore& store, FrameId keyframe,
                                           std::optional<int> after_session = std::nullopt);

}  // namespace revisit
