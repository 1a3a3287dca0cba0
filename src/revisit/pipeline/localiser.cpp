// SPDX-License-Identifier: Apache-2.0
#include <revisit/pipeline/localiser.hpp>

#include <algorithm>
#include <cmath>
#include <utility>

#include <revisit/registration/sweep_motion.hpp>
#include <revisit/store/sensor_facts.hpp>
#include <revisit/store/stored_clouds.hpp>
#include <revisit/store/stored_map.hpp>

namespace revisit {
namespace {

struct Moving {
  static constexpr double kHopeless_log_odds = -15.0, kCertain_log_odds = 9.0;
  static constexpr double kStill_m = 0.1, kArm_m = 10.0;  ///< within a sweep; a turn counts at this distance
};

}  // namespace

const char* to_string(Localisation::Status status) {
  switch (status) {
    case Localisation::Status::kLost:
      return "lost";
    case Localisation::Status::kFound:
      return "found";
    case Localisation::Status::kFollowed:
      return "followed";
    case Localisation::Status::kPredicted:
      return "predicted";
  }
  return "";
}

Localiser::Localiser(SavedPlaces map, const Parameters& parameters, LogSink log,
                     const std::optional<IntensityScale>& scale)
    : parameters_(parameters),
      map_(std::move(map)),
      preparation_(parameters, scale, {}, std::move(log)),
      recognition_(parameters, clouds_in_store(map_.store()), map_.take_index()) {
  for (const StoredMapPose& each : map_.poses())
    recognition_.set_point(each.keyframe, point_in_map(each.T_map_lidar, each.part));
}

Result<Localiser> Localiser::open(const std::filesystem::path& path, const Parameters& parameters, LogSink log,
                                  const std::optional<IntensityScale>& scale) {
  if (const Status status = validate(parameters); !status) return status.error();
  auto map = SavedPlaces::open(path, parameters);
  if (!map) return map.error();
  Localiser localiser(*std::move(map), parameters, std::move(log), scale);
  // What the last session knows: of several sensors, the one that was used last.
  for (const StoredSession& session : localiser.map_.sessions()) {
    const auto sensor = to_sensor_facts(session.sensor);
    if (!sensor) return Error{path.string() + ": " + sensor.error().message};
    if (!*sensor) continue;
    localiser.typical_ = (*sensor)->typical;
    localiser.recognition_.set_look_alikes((*sensor)->look_alikes_log_odds);
  }
  return localiser;
}

Localisation Localiser::found(FrameId frame, const LoopConstraint& loop) const {
  Localisation result;
  result.frame = frame;
  result.status = Localisation::Status::kFound;
  result.T_map_lidar = map_.T_map_lidar(loop.match) * loop.T_match_query;
  result.probability = loop.probability;
  result.information = loop.information;
  result.match = loop.match;
  return result;
}

// A sector of a street fits elsewhere, too, where nothing can contradict it: one scan never decides. One of a room does
// where it shows more than those of other rooms do.
void Localiser::ask_for_more_views(Detection& detection) {
  if (!detection.loop) return;
  const auto registered = std::find_if(detection.registered.begin(), detection.registered.end(),
                                       [&](const auto& each) { return each.match == detection.loop->match; });
  if (registered == detection.registered.end() || registered->evidence.decides_alone()) return;
  detection.refusal = Refusal{Refusal::Reason::kOneView, detection.loop->probability, 0.0};
  detection.loop.reset();
}

Result<Localisation> Localiser::locate(Scan scan) {
  auto prepared = preparation_.prepare(scan);
  if (!prepared) return prepared.error();
  auto detection = recognition_.find(*prepared, places(), typical_);
  if (!detection) return detection.error();
  const auto motion = motion_of(*prepared, *detection);
  if (!motion) return motion.error();
  if (*motion) {
    // Once more where it fits best, without what the motion did to it. The surer answer counts, as poses or as
    // refusals do.
    auto undistorted = preparation_.prepare(std::move(scan), **motion);
    if (undistorted) {
      auto again = recognition_.find_there(*undistorted, *detection, typical_);
      if (!again) return again.error();
      const Detection::Registered *const likeliest = detection->likeliest(), *const now = again->likeliest();
      if (now != nullptr && now->evidence.own_log_odds > likeliest->evidence.own_log_odds) {
        detection = std::move(again);
        prepared = std::move(undistorted);
      }
    }
  }
  // Before places are believed together that are not enough alone: what else looks like the scan?
  if (!detection->loop && !detection->tried_further) {
    detection = recognition_.find(*prepared, places(), typical_, true);
    if (!detection) return detection.error();
  }
  if (const Status looked = look_nearby(*prepared, *detection); !looked) return looked.error();
  ask_for_more_views(*detection);
  Localisation result;
  if (detection->loop) result = found(prepared->scan.frame, *detection->loop);
  result.frame = prepared->scan.frame;
  result.reason = detection->reason();
  result.detection = *std::move(detection);
  return result;
}

// How the sensor moved during a sweep that nobody followed, as the best place that was tried shows it. Nothing where
// the scan is certain as it is, fits nowhere, or hardly moved.
Result<std::optional<Twist>> Localiser::motion_of(const PreparedScan& scan, const Detection& detection) const {
  const Detection::Registered* const best = detection.likeliest();
  if (scan.scan.times_s.empty() || best == nullptr || best->evidence.own_log_odds < Moving::kHopeless_log_odds ||
      best->evidence.own_log_odds > Moving::kCertain_log_odds)
    return std::optional<Twist>();
  const auto place = recognition_.geometry(best->match);
  if (!place) return place.error();
  const auto found = find_sweep_motion((*place)->surface(), scan.scan, best->evidence.T_match_query,
                                       best->evidence.evidence.in_the_open);
  if (!found) return std::optional<Twist>();
  const auto [first_s, last_s] = std::minmax_element(scan.scan.times_s.begin(), scan.scan.times_s.end());
  const double sweep_s = static_cast<double>(*last_s - *first_s);
  const bool is_still =
      sweep_s * (found->motion.linear_mps.norm() + Moving::kArm_m * found->motion.angular_radps.norm()) <
      Moving::kStill_m;
  return is_still ? std::optional<Twist>() : std::optional(found->motion);
}

void Localiser::set_verification(const Parameters& parameters) {
  recognition_.set_verification(require_valid(parameters));
  parameters_.temporal = parameters.temporal;
  parameters_.geometric = parameters.geometric;
}

}  // namespace revisit
