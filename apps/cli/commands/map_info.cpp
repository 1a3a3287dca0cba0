// SPDX-License-Identifier: Apache-2.0
#include <cstdio>
#include <map>
#include <set>

#include <revisit/core/text.hpp>
#include <revisit/localisation/saved_map.hpp>
#include <revisit/localisation/saved_places.hpp>
#include <revisit/mapping/earth_frame.hpp>
#include <revisit/store/sensor_facts.hpp>

#include "common.hpp"
#include "reports/table.hpp"

namespace revisit::cli {

int info_of_map(const std::string& path, bool check) {
  const auto map = SavedMap::open(path);
  if (!map) return fail(map.error());
  std::error_code failure;
  const std::string& file = map->store()->file();
  std::printf("map          %s, %.1f MB\n", file.c_str(),
              static_cast<double>(std::filesystem::file_size(file, failure)) / 1e6);
  struct Counts {
    std::size_t keyframes = 0;
    double length_m = 0.0;
    std::set<int> parts;
  };
  std::map<int, Counts> sessions;
  std::map<int, std::pair<Eigen::Vector3d, Eigen::Vector3d>> bounds;  // of the parts
  const StoredMap::Keyframe* before = nullptr;
  for (const auto& each : map->stored().keyframes) {
    const FrameId frame = each.frame.frame;
    Counts& counts = sessions[session_of(frame)];
    ++counts.keyframes;
    const int part = map->part(frame);
    counts.parts.insert(part);
    const Eigen::Vector3d p = map->T_map_lidar(frame).translation();
    const auto [at, is_new] = bounds.try_emplace(part, p, p);
    if (!is_new) at->second = {at->second.first.cwiseMin(p), at->second.second.cwiseMax(p)};
    if (before != nullptr && before->point.segment == each.point.segment)
      counts.length_m += T_between(before->point, each.point).translation().norm();
    before = &each;
  }
  std::printf("key frames   %zu, %zu loops between them\n", map->stored().keyframes.size(), map->stored().loops.size());
  for (const auto& [part, box] : bounds) {
    const Eigen::Vector3d size = box.second - box.first;
    std::printf("part %-7d %.0f x %.0f m, heights over %.1f m\n", part, size.x(), size.y(), size.z());
  }
  const auto fixes = map->store()->fixes();
  const auto earth = map->store()->earth();
  if (!fixes || !earth) return fail(fixes ? earth.error() : fixes.error());
  for (const StoredEarth& each : *earth) {
    const Eigen::Vector3d begin = each.T_earth_map.translation();
    const EarthFrame frame = EarthFrame(each.latitude_deg, each.longitude_deg, each.altitude_m).with_zone_of(begin);
    const Eigen::Vector3d at = frame.geodetic(begin);
    std::printf("on the earth part %d begins at %.7f, %.7f degrees, %.1f m", each.part, at.x(), at.y(), at.z());
    if (const auto utm = frame.to_utm(each.T_earth_map))
      std::printf("; UTM %s (EPSG:%d) %.2f, %.2f", frame.utm_zone().c_str(), frame.epsg(), utm->translation().x(),
                  utm->translation().y());
    std::printf("; %zu GPS fixes\n", fixes->size());
  }
  Table table = {{"session", "recording", "key frames", "length", "part"}};
  for (const StoredSession& session : map->stored().sessions) {
    const Counts& counts = sessions[session.id];
    std::string parts;
    if (counts.keyframes == 0) parts = "on known ground";
    for (const int part : counts.parts) parts += (parts.empty() ? "" : ", ") + std::to_string(part);
    table.push_back({std::to_string(session.id), session.recording, std::to_string(counts.keyframes),
                     format("%.0f m", counts.length_m), parts});
  }
  std::printf("%s", to_text(table).c_str());
  if (bounds.size() > 1) std::printf("Between parts nothing was found in common: each has coordinates of its own.\n");
  if (!check) return kDone;
  if (const Status status = map->store()->check(); !status) return fail(status.error());
  if (const Status status = SavedPlaces::check(path); !status) return fail(status.error());
  std::printf("Every row is what was written.\n");
  return kDone;
}

}  // namespace revisit::cli
