// SPDX-License-Identifier: Apache-2.0
#include <revisit/pipeline/localiser.hpp>

#include <utility>

#include <revisit/store/sensor_facts.hpp>
#include <revisit/store/stored_clouds.hpp>

namespace revisit {

Localiser::Localiser(SavedMap map, const Parameters& parameters, LogSink log)
    : map_(std::move(map)),
      preparation_(parameters, std::nullopt, {}, std::move(log)),
      recognition_(parameters, clouds_in_store(map_.store())) {}

Result<Localiser> Localiser::open(const std::filesystem::path& path, const Parameters& parameters, LogSink log) {
  if (const Status status = validate(parameters); !status) return status.error();
  auto map = SavedMap::open(path);
  if (!map) return map.error();
  Localiser localiser(*std::move(map), parameters, std::move(log));
  const SavedMap& opened = localiser.map_;
  const auto add_place = [&](const StoredMap::Keyframe& place, const IntensityScanContext& descriptor) {
    const FrameId frame = place.frame.frame;
    localiser.recognition_.restore(place.frame, descriptor,
                                   point_in_map(opened.T_map_lidar(frame), opened.part(frame)));
  };
  if (const Status status = restore_places(*opened.store(), opened.stored(), parameters.descriptor, add_place); !status)
    return Error{path.string() + ": " + status.error().message};
  // What the last session knows: of several sensors, the one that was used last.
  for (const StoredSession& session : opened.stored().sessions) {
    const auto sensor = to_sensor_facts(session.sensor);
    if (!sensor) return Error{path.string() + ": " + sensor.error().message};
    if (!*sensor) continue;
    localiser.typical_ = (*sensor)->typical;
    localiser.recognition_.set_look_alikes((*sensor)->look_alikes_log_odds);
  }
  return localiser;
}

Result<Localisation> Localiser::locate(Scan scan) {
  const auto prepared = preparation_.prepare(std::move(scan));
  if (!prepared) return prepared.error();
  auto detection = recognition_.find(*prepared, places(), typical_);
  if (!detection) return detection.error();
  Localisation result;
  if (const auto& loop = detection->loop) {
    result.T_map_lidar = map_.T_map_lidar(loop->match) * loop->T_match_query;
    result.probability = loop->probability;
    result.information = loop->information;
  }
  result.detection = *std::move(detection);
  return result;
}

}  // namespace revisit
