// SPDX-License-Identifier: Apache-2.0
// Localiser, scan after scan: following, and waking up on the way.
#include <algorithm>
#include <cmath>

#include <revisit/core/text.hpp>
#include <revisit/pipeline/localiser.hpp>
#include <revisit/preprocess/range_filter.hpp>

namespace revisit {
namespace {

struct Staying {
  // Of a scan that was registered where it was predicted: it is there unless its own evidence speaks against it.
  static constexpr double kLeast_log_odds = -3.0, kLeastOfNarrow_log_odds = -8.0;
  static constexpr double kMost_m = 0.6, kMost_mAMetre = 0.03, kMost_deg = 4.0;  ///< from the prediction
  static constexpr double kLost_m = 15.0;                                        ///< travelled without seeing the map
  static constexpr double kLost_s = 6.0;
  static constexpr double kDrift = 0.01;  ///< of odometry, a standard deviation for each metre
};

struct Expecting {
  static constexpr double kNear_m = 4.0, kNear_deg = 40.0;  ///< by hand, on a picture of the map
  static constexpr double kDrive_m = 20.0;                  ///< for which it is remembered
  static constexpr std::size_t kPlaces = 4;
};

bool is_near(const Pose& T_expected, const Pose& T) {
  const Pose off = T_expected.inverse() * T;
  return off.translation().norm() <= Expecting::kNear_m && rotation_angle(off) <= to_radians(Expecting::kNear_deg);
}

// What a pose is known to be after so much odometry.
Matrix6 after_motion(const Matrix6& information, double metres) {
  if (information.isZero() || metres <= 0.0) return information;
  const double variance_m2 = std::pow(Staying::kDrift * metres, 2), variance_rad2 = 0.01 * variance_m2;
  Vector6 diagonal;
  diagonal << Eigen::Vector3d::Constant(variance_m2), Eigen::Vector3d::Constant(variance_rad2);
  const Matrix6 prior = Vector6::Constant(1e-6).asDiagonal();
  const Matrix6 covariance = Matrix6((information + prior).inverse()) + Matrix6(diagonal.asDiagonal());
  const Matrix6 after = covariance.inverse();
  return 0.5 * (after + after.transpose());
}

}  // namespace

Result<Localisation> Localiser::follow(Scan scan, const std::optional<Pose>& T_external_lidar) {
  filter_range(scan, parameters_.preprocess);
  const FrameId frame = scan.frame;
  if (scan.points.empty()) return Error{to_text(frame) + ": no point within the range filter"};
  const OdometryStep step = odometry_.follow(scan, T_external_lidar);
  scan.stamp_s = step.stamp_s;
  if (step.up) scan.up = step.up;
  if (point_ && point_->segment == step.segment)
    point_ = point_->to(step.T_odom_lidar);
  else
    point_ = TrajectoryPoint{.segment = step.segment, .T_segment_lidar = step.T_odom_lidar, .origin = step.segment};
  if (following_ && following_->at.segment != point_->segment) following_.reset();  // odometry has lost itself
  if (expected_ && !expected_->at) expected_->at = *point_;
  if (expected_ && (expected_->at->segment != point_->segment ||
                    point_->travelled_m - expected_->at->travelled_m > Expecting::kDrive_m))
    expected_.reset();
  auto prepared = preparation_.prepare(std::move(scan), step.motion);
  if (!prepared) return prepared.error();
  if (following_) {
    auto stayed = stay(*prepared, *point_);
    if (!stayed || stayed->status != Localisation::Status::kLost) return stayed;
  }
  auto result = wake_up(*prepared, *point_);
  if (result) result->frame = frame;
  return result;
}

bool Localiser::is_sure(const PoseBelief::Hypothesis& best) const {
  return probability_of(best.log_odds) >= parameters_.geometric.min_probability &&
         (!best.resembles_others || best.log_odds >= GeometricEvidence::kSureInRooms_log_odds);
}

Result<Localisation> Localiser::wake_up(const PreparedScan& scan, const TrajectoryPoint& point) {
  auto detection = recognition_.find(scan, places(), typical_);
  if (!detection) return detection.error();
  ask_for_more_views(*detection);
  if (expected_)
    if (const Status looked = look_where_expected(scan, point, *detection); !looked) return looked.error();
  std::vector<PoseBelief::Sighting> sightings;
  for (const Detection::Registered& each : detection->registered) {
    sightings.push_back(sighting(each.match, each.evidence));
    sightings.back().prior_log_odds = expectation_log_odds(sightings.back().T_map_lidar, sightings.back().part, point);
  }
  belief_.add(point, sightings);
  Localisation result;
  result.reason = detection->reason();
  const auto best = belief_.best();
  const double probability = best ? probability_of(best->log_odds) : 0.0;
  if (detection->loop) {
    result = found(scan.scan.frame, *detection->loop);
  } else if (best && is_sure(*best)) {
    result.status = Localisation::Status::kFound;
    result.T_map_lidar = best->T_map_segment * point.T_segment_lidar;
    result.probability = probability;
    result.match = best->match;
    for (const Detection::Registered& each : detection->registered)
      if (each.match == best->match) result.information = each.evidence.information;
  }
  if (result.T_map_lidar) {
    following_ = Following{*result.T_map_lidar * point.T_segment_lidar.inverse(),
                           point,
                           scan.scan.stamp_s,
                           map_.part(result.match),
                           result.match,
                           result.information,
                           result.probability};
    result.reason.clear();  // of one scan alone, which may not have been enough
    belief_.clear();
    expected_.reset();
  }
  result.frame = scan.scan.frame;
  result.detection = *std::move(detection);
  return result;
}

void Localiser::expect(const Pose& T_map_lidar) {
  const StoredMapPose* nearest = nullptr;
  const auto distance_m = [&](const StoredMapPose& each) {
    return (each.T_map_lidar.translation() - T_map_lidar.translation()).head<2>().norm();
  };
  for (const StoredMapPose& each : map_.poses())
    if (each.part == 0 && (nearest == nullptr || distance_m(each) < distance_m(*nearest))) nearest = &each;
  if (nearest == nullptr) return;
  // As high as the place beside it, and tilted as it is.
  const double turn_rad = yaw_of(T_map_lidar) - yaw_of(nearest->T_map_lidar);
  Pose T = Pose::Identity();
  T.translation() << T_map_lidar.translation().head<2>(), nearest->T_map_lidar.translation().z();
  T.linear() = Eigen::AngleAxisd(turn_rad, Eigen::Vector3d::UnitZ()) * nearest->T_map_lidar.linear();
  expected_ = Expected{T, std::nullopt};
  following_.reset();
  belief_.clear();
}

double Localiser::expectation_log_odds(const Pose& T_map_lidar, int part, const TrajectoryPoint& point) const {
  if (!expected_ || part != 0) return 0.0;
  const Pose T_expected = expected_->at_point(point);
  return is_near(T_expected, T_map_lidar) ? log_odds_of_elsewhere(T_expected, part) : 0.0;
}

double Localiser::log_odds_of_elsewhere(const Pose& T_map_lidar, int part) const {
  std::size_t there = 1;
  for (const StoredMapPose& each : map_.poses())
    there +=
        each.part == part && (each.T_map_lidar.translation() - T_map_lidar.translation()).norm() <= Expecting::kNear_m;
  return std::log(std::max(1.0, static_cast<double>(map_.poses().size()) / static_cast<double>(there)));
}

Status Localiser::look_where_expected(const PreparedScan& scan, const TrajectoryPoint& point, Detection& detection) {
  for (const PosePrediction& each : nearest_places(expected_->at_point(point), 0, Expecting::kPlaces)) {
    const auto tested = recognition_.test(scan, each, typical_);
    if (!tested) return tested.error();
    if (tested->geometric) detection.registered.push_back({each.match, *tested->geometric});
  }
  return ok();
}

PoseBelief::Sighting Localiser::sighting(FrameId match, const GeometricEvidence& found) const {
  const bool resembles_others = found.evidence.resembles_others();
  return {.match = match,
          .part = map_.part(match),
          .T_map_lidar = map_.T_map_lidar(match) * found.T_match_query,
          .log_odds = PoseBelief::log_odds_of_view(found.own_log_odds, found.decides_alone(), resembles_others),
          .resembles_others = resembles_others};
}

// Odometry, or the map, has a jump: what scans in a row say against it counts as where somebody expects it.
bool Localiser::believe_beside(const PosePrediction& prediction, const GeometricEvidence& found,
                               const TrajectoryPoint& point) {
  PoseBelief::Sighting seen = sighting(prediction.match, found);
  const Pose T_predicted = map_.T_map_lidar(prediction.match) * prediction.T_match_query;
  if (!found.is_consistent() || !is_near(T_predicted, seen.T_map_lidar)) return false;
  seen.prior_log_odds = log_odds_of_elsewhere(T_predicted, seen.part);
  belief_.add(point, std::span(&seen, 1));
  const auto best = belief_.best();
  return best && best->T_map_segment.isApprox(seen.T_map_lidar * point.T_segment_lidar.inverse()) && is_sure(*best);
}

Result<Localisation> Localiser::stay(const PreparedScan& scan, const TrajectoryPoint& point) {
  Following& state = *following_;
  const double travelled_m = point.travelled_m - state.at.travelled_m;
  Localisation result;
  result.frame = scan.scan.frame;
  const Pose T_predicted = state.T_map_segment * point.T_segment_lidar;
  const auto nearest = nearest_places(T_predicted, state.part, 1);
  const PosePrediction* const prediction = nearest.empty() ? nullptr : &nearest.front();
  if (prediction != nullptr) {
    const auto tested = recognition_.test(scan, *prediction, typical_);
    if (!tested) return tested.error();
    if (tested->geometric) {
      const GeometricEvidence& evidence = *tested->geometric;
      const Pose off = prediction->T_match_query.inverse() * evidence.T_match_query;
      const double least =
          evidence.evidence.one_is_narrow ? Staying::kLeastOfNarrow_log_odds : Staying::kLeast_log_odds;
      // Streets differ enough, and of a sector of one a right pose shows little.
      const FollowingTrust trust =
          evidence.evidence.in_the_open
              ? state.trust
              : state.trust.after(evidence.own_log_odds - least + Staying::kLeast_log_odds, travelled_m);
      if (trust.is_gone()) {
        following_.reset();
        result.reason = "what was seen over the last metres is not what the map shows here";
        return result;
      }
      const bool is_there = evidence.own_log_odds >= least &&
                            off.translation().norm() <= Staying::kMost_m + Staying::kMost_mAMetre * travelled_m &&
                            rotation_angle(off) <= to_radians(Staying::kMost_deg);
      if (is_there || believe_beside(*prediction, evidence, point)) {
        belief_.clear();
        result.status = Localisation::Status::kFollowed;
        result.T_map_lidar = map_.T_map_lidar(prediction->match) * evidence.T_match_query;
        result.information = evidence.information;
        result.probability = std::max(evidence.probability, state.probability);
        result.match = prediction->match;
        state = {*result.T_map_lidar * point.T_segment_lidar.inverse(),
                 point,
                 scan.scan.stamp_s,
                 state.part,
                 result.match,
                 result.information,
                 result.probability,
                 trust};
        return result;
      }
      result.reason = format("does not fit the map where it is predicted: inliers %.2f, %.2f m off",
                             evidence.evidence.inlier_ratio, off.translation().norm());
    }
  }
  if (result.reason.empty())
    result.reason = prediction != nullptr ? "does not fit the map where it is predicted"
                                          : format("no place of the map is within %.0f m", kFarFromPlaces_m);
  if (travelled_m > Staying::kLost_m || scan.scan.stamp_s - state.stamp_s > Staying::kLost_s) {
    following_.reset();
    return result;
  }
  result.status = Localisation::Status::kPredicted;
  result.T_map_lidar = T_predicted;
  result.information = after_motion(state.information, travelled_m);
  result.probability = state.probability;
  result.match = state.match;
  return result;
}

}  // namespace revisit
