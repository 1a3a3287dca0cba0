// SPDX-License-Identifier: Apache-2.0
#include <revisit/pipeline/map_on_earth.hpp>

#include <algorithm>

namespace revisit {

Result<std::optional<MapOnEarth>> MapOnEarth::of(const MapStore& store, int part) {
  const auto earth = store.earth();
  if (!earth) return earth.error();
  const auto found =
      std::find_if(earth->begin(), earth->end(), [part](const StoredEarth& each) { return each.part == part; });
  if (found == earth->end()) return std::optional<MapOnEarth>();
  const EarthFrame frame(found->latitude_deg, found->longitude_deg, found->altitude_m);
  return std::optional(MapOnEarth(frame.with_zone_of(found->T_earth_map.translation()), found->T_earth_map));
}

Eigen::Vector3d MapOnEarth::round_offset_m(const Pose& T_utm) {
  constexpr double kRound_m = 100.0;
  Eigen::Vector3d offset_m = kRound_m * (T_utm.translation() / kRound_m).array().floor();
  offset_m.z() = 0.0;
  return offset_m;
}

void MapOnEarth::place_las(MapOptions& options) const {
  const auto origin = to_utm(Pose::Identity());
  if (!origin) return;
  options.las_offset_m = round_offset_m(*origin);
  options.las_epsg = frame_.epsg();
  // Metres and directions of the grid differ a little from place to place.
  options.T_las_world = [*this, origin = *origin, offset_m = options.las_offset_m](const Eigen::Vector3d& near_m) {
    const Pose T_world_near(Eigen::Translation3d{near_m});
    Pose T = to_utm(T_world_near).value_or(origin * T_world_near) * T_world_near.inverse();
    T.translation() -= offset_m;
    return T;
  };
}

}  // namespace revisit
