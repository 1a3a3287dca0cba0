// SPDX-License-Identifier: Apache-2.0
#include <revisit/odometry/match_judgement.hpp>

#include <algorithm>

namespace revisit {
namespace {

// Chosen on simulated drives and KITTI raw 0005 (docs/slam.md, docs/history.md).
constexpr double kFewestMatched = 0.3;     // share of the points of a scan that is tracked
constexpr double kBelowTypical = 0.2;      // what it may fall below the running mean
constexpr double kBelowUnpredicted = 0.1;  // the same, where nothing says what was driven since
constexpr double kOfTypical = 0.7;         // share of a running mean that is low itself, of a sparse sensor
// Share of what the last tracked scan had on upright surfaces: the ground fits wherever the sensor went. Right steps
// have .35 and more of it, the first wrong ones of cars whose turn ended between two scans .06 to .08.
constexpr double kLeastOfLastSideways = 0.3;
constexpr double kMostSlip = 0.6, kSlip_m = 0.1;  // of what wheels measure, and so much more
// The first scans of a sparse sensor meet few surfaces; those that they meet must fit.
constexpr double kFewestMatchedAtFirst = 0.1, kFittingAtFirst = 0.6;
// Beside what is new: share of all points, and of those that meet something (less where an IMU is trusted); and share
// of all that was seen through.
constexpr double kFewestBesideNew = 0.15, kFittingBesideNew = 0.7, kFittingAsForeseen = 0.5, kMostContradicted = 0.06;
constexpr double kLongestAssumed = 5.0;             // that times may be apart, of what is assumed where there are none
constexpr double kFineVoxels = 0.3, kFine_m = 0.1;  // narrowest kernel: so many voxels and so much more

}  // namespace

double fine_width_m(const LocalMap& map) { return kFineVoxels * map.voxel_m() + kFine_m; }

// The longer ago the last scan was tracked, the farther may the sensor be from where it was predicted.
MatchJudgement::MatchJudgement(const LocalMap& map, const TrackState& track, const MatcherScan& scan, double stamp_s,
                               const ScanMatch& predicted, const Pose& T_previous_start)
    : map_(map),
      track_(track),
      scan_(scan),
      measured_m_(predicted.measured_m),
      gap_s_(stamp_s - track.last_stamp_s),
      untracked_s_((stamp_s - track.tracked_stamp_s) * (scan.is_stamp_assumed ? kLongestAssumed : 1.0)),
      is_turn_known_(predicted.is_turn_measured && track.imu_trust.is_trusted()),
      is_predicted_(measured_m_ || untracked_s_ <= TrackState::kLongestExtrapolation_s),
      limits_(track.T_odom_lidar * T_previous_start, untracked_s_) {}

bool MatchJudgement::is_possible(const IcpResult& found) const {
  // Wheels slip, but not like this: it is the surroundings that move along with the sensor.
  const double found_m = (track_.T_odom_tracked.inverse() * found.T_target_source).translation().norm();
  const double wheels_m = track_.untracked_m + measured_m_.value_or(0.0);
  if (measured_m_ && wheels_m - found_m > kSlip_m + kMostSlip * wheels_m) return false;
  return !track_.motion || gap_s_ <= 0.0 || !limits_.slides(found);
}

bool MatchJudgement::is_credible(const IcpResult& found) const {
  if (found.matched_sideways < kLeastOfLastSideways * track_.last_sideways) return false;
  if (is_predicted_ && track_.scans < TrackState::kFirstScans)
    return found.matched >= kFewestMatchedAtFirst && found.matched >= kFittingAtFirst * found.met;
  return found.matched >= std::max(std::min(kFewestMatched, kOfTypical * track_.typical_match),
                                   track_.typical_match - (is_predicted_ ? kBelowTypical : kBelowUnpredicted));
}

bool MatchJudgement::fits(const IcpResult& found) const {
  return found.converged && is_possible(found) && is_credible(found);
}

bool MatchJudgement::fits_beside_new(const IcpResult& found) const {
  const double fitting = is_turn_known_ ? kFittingAsForeseen : kFittingBesideNew;
  if (track_.scans < TrackState::kFirstScans || !is_predicted_ || !found.converged || !is_possible(found) ||
      !limits_.is_near(found) || found.matched < std::max(kFewestBesideNew, fitting * found.met))
    return false;
  return track_.last_view.contradicted(map_, scan_.points, found.T_target_source,
                                       std::max(fine_width_m(map_), map_.voxel_m())) <= kMostContradicted;
}

}  // namespace revisit
