// SPDX-License-Identifier: Apache-2.0
#include <revisit/pipeline/localiser.hpp>

#include <utility>

#include <revisit/store/stored_clouds.hpp>

namespace revisit {

Localiser::Localiser(SavedMap map, const Parameters& parameters, LogSink log)
    : map_(std::move(map)),
      preparation_(parameters, std::nullopt, {}, std::move(log)),
      recognition_(parameters, clouds_in_store(map_.store())) {
  if (const auto& sensor = map_.session().sensor) typical_ = sensor->typical;
}

Result<Localiser> Localiser::open(const std::filesystem::path& path, const Parameters& parameters, LogSink log) {
  if (const Status status = validate(parameters); !status) return status.error();
  auto map = SavedMap::open(path);
  if (!map) return map.error();
  Localiser localiser(*std::move(map), parameters, std::move(log));
  const auto add_place = [&](const FrameTime& frame, const IntensityScanContext& descriptor,
                             const std::optional<TrajectoryPoint>& point) {
    localiser.recognition_.restore(frame, descriptor, point);
  };
  const SavedMap& opened = localiser.map_;
  if (const Status status = restore_places(*opened.store(), opened.session(), parameters.descriptor, add_place);
      !status)
    return Error{path.string() + ": " + status.error().message};
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
