// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include <revisit/mapping/build_map.hpp>
#include <revisit/mapping/earth_frame.hpp>
#include <revisit/store/map_store.hpp>

namespace revisit {

/// A part of a map that GPS placed, in the grid of the UTM zone that it lies in. Safe to share between threads.
class MapOnEarth {
 public:
  /// Nothing where the map does not know where on the earth this part is.
  static Result<std::optional<MapOnEarth>> of(const MapStore& store, int part);

  const EarthFrame& frame() const { return frame_; }
  /// Nothing for poses far out of the zone.
  std::optional<Pose> to_utm(const Pose& T_map) const { return frame_.to_utm(T_earth_map_ * T_map); }
  /// Points are kept as 32-bit numbers, which hold no millions: what is to be taken from coordinates near `T_utm`.
  static Eigen::Vector3d round_offset_m(const Pose& T_utm);
  /// Lets map.las be in the zone; the other files stay in the map's frame.
  void place_las(MapOptions& options) const;

 private:
  MapOnEarth(const EarthFrame& frame, const Pose& T_earth_map) : frame_(frame), T_earth_map_(T_earth_map) {}

  EarthFrame frame_;
  Pose T_earth_map_;
};

}  // namespace revisit
