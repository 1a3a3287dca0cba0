// SPDX-License-Identifier: Apache-2.0
// Localiser: what the places beside the best one say.
#include <algorithm>
#include <cmath>

#include <revisit/localisation/agreeing_places.hpp>
#include <revisit/pipeline/localiser.hpp>
#include <revisit/verification/acceptance.hpp>
#include <revisit/verification/loop_probability.hpp>

namespace revisit {
namespace {

struct Nearby {
  static constexpr double kWorthwhile_log_odds = -4.0;
  static constexpr std::size_t kPlaces = 4;
  static constexpr double kSame_m = 1.0, kSame_deg = 5.0;  ///< the same pose
};

bool are_the_same(const Pose& a, const Pose& b) {
  const Pose apart = a.inverse() * b;
  return apart.translation().norm() <= Nearby::kSame_m && rotation_angle(apart) <= to_radians(Nearby::kSame_deg);
}

}  // namespace

std::vector<PosePrediction> Localiser::nearest_places(const Pose& T_map_lidar, int part, std::size_t count) const {
  std::vector<std::pair<double, const StoredMapPose*>> nearest;
  for (const StoredMapPose& each : map_.poses()) {
    const double distance_m2 = (each.T_map_lidar.translation() - T_map_lidar.translation()).squaredNorm();
    if (each.part != part || distance_m2 >= std::pow(kFarFromPlaces_m, 2)) continue;
    if (nearest.size() == count && distance_m2 >= nearest.back().first) continue;
    if (nearest.size() == count) nearest.pop_back();
    nearest.insert(std::upper_bound(nearest.begin(), nearest.end(), std::pair(distance_m2, &each)),
                   {distance_m2, &each});
  }
  std::vector<PosePrediction> predictions;
  predictions.reserve(nearest.size());
  for (const auto& [distance_m2, place] : nearest)
    predictions.push_back({place->keyframe, place->T_map_lidar.inverse() * T_map_lidar, 0.0});
  return predictions;
}

// What is nearer shows more of the same: a pose that no place tried so far makes certain may be certain from one
// beside, or from several together.
Status Localiser::look_nearby(const PreparedScan& scan, Detection& detection) {
  const Detection::Registered* const best = detection.likeliest();
  if (detection.loop || best == nullptr || best->evidence.own_log_odds < Nearby::kWorthwhile_log_odds) return ok();
  const Pose T_map_lidar = map_.T_map_lidar(best->match) * best->evidence.T_match_query;
  for (const PosePrediction& each : nearest_places(T_map_lidar, map_.part(best->match), Nearby::kPlaces)) {
    const bool is_tried = std::any_of(detection.registered.begin(), detection.registered.end(),
                                      [&](const auto& other) { return other.match == each.match; });
    if (is_tried || detection.loop) continue;
    const auto tested = recognition_.test(scan, each, typical_);
    if (!tested) return tested.error();
    if (!tested->geometric) continue;
    const GeometricEvidence& found = *tested->geometric;
    detection.registered.push_back({each.match, found});
    if (tested->is_accepted() && are_the_same(each.T_match_query, found.T_match_query))
      accept(detection, each.match, found, tested->score());
  }
  if (!detection.loop) accept_together(detection);
  return ok();
}

// The likeliest pose, where the places that show the scan there are enough together, though none of them is.
void Localiser::accept_together(Detection& detection) const {
  const Detection::Registered& best = *detection.likeliest();
  const auto pose = [this](const Detection::Registered& each) {
    return map_.T_map_lidar(each.match) * each.evidence.T_match_query;
  };
  AgreeingPlaces places;
  for (const Detection::Registered& each : detection.registered)
    if (map_.part(each.match) == map_.part(best.match) && are_the_same(pose(best), pose(each)))
      places.add(each.match, each.evidence.own_log_odds);
    else
      places.add_against(each.evidence.own_log_odds);
  GeometricEvidence found = best.evidence;
  decide(found, found.own_log_odds - loop_log_odds(found.evidence), places.log_odds() - found.own_log_odds,
         parameters_.geometric);
  if (found.is_consistent()) accept(detection, best.match, found, detection.score);
}

void Localiser::accept(Detection& detection, FrameId match, const GeometricEvidence& found, double score) {
  detection.loop = to_loop(detection.frame, match, found, score);
  detection.refusal.reset();
}

}  // namespace revisit
