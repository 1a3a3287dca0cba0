// SPDX-License-Identifier: Apache-2.0
#include <revisit/odometry/scan_search.hpp>

#include <algorithm>
#include <cmath>

#include <Eigen/Eigenvalues>

#include <revisit/odometry/pose_prior.hpp>
#include <revisit/odometry/starts_in_a_gap.hpp>

namespace revisit {
namespace {

// Chosen on simulated drives and KITTI raw 0005 (docs/slam.md, docs/history.md).
constexpr double kFarSearch_m = 2.0;     // where the prediction failed
constexpr double kNarrowSearch_m = 0.3;  // where a wide search found what cannot be
constexpr double kSettled_m = 2e-3;
constexpr double kLeastSeen = 1e-3;  // a point in a thousand that faces a direction (IcpOptions)
constexpr double kSteady_m = 0.02;   // rocking between two voxels counts as converged
constexpr double kNoise_m = 0.03;    // of points, where patches count by their variance
// What faces the axis of rings, to within so much, fixes nothing across it. The lines of few rings lie on no surface
// together: in crowns their planes lean as the beams do.
constexpr double kLevel_deg = 8.0, kLevelOfFew_deg = 20.0;
constexpr std::uint32_t kFewRings = 32;
constexpr double kTurnsTried_deg[] = {0.0, 5.0, -5.0, 10.0, -10.0};  // where the prediction failed
constexpr double kFastestTurn_degps = 300.0, kTurnStep_deg = 15.0;   // since the last scan that was tracked
constexpr std::size_t kFewestToTurn = 300;                           // points: fewer fit at many headings
constexpr std::size_t kFew = 1000;          // points of a scan, about, with which these are tried
constexpr std::size_t kSettlesWith = 2000;  // points of a scan, about, until all are registered
constexpr double kFixed_m = 0.04;           // a position that scans fix, a standard deviation
constexpr double kStartInMotion_m = 1.0;    // tried on every side
// Another pose counts where so much more lies on what is upright; one with less than so much of what the last scan had
// there is doubtful.
constexpr double kBetter = 1.1, kDoubtful = 0.7;

double level_deg(std::uint32_t rings) {
  if (rings == 0) return 0.0;
  return rings <= kFewRings ? kLevelOfFew_deg : kLevel_deg;
}

// Whether the scan by itself tells the position in every direction.
bool fixes_position(const IcpResult& icp) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(icp.position_information, Eigen::EigenvaluesOnly);
  return axes.eigenvalues()(0) * kFixed_m * kFixed_m >= 1.0;
}

}  // namespace

ScanSearch::ScanSearch(const LocalMap& map, const TrackState& track, const MatcherScan& scan, double stamp_s,
                       const ScanMatch& expected)
    : map_(map),
      track_(track),
      scan_(scan),
      T_previous_start_(expected.T_previous_start),
      is_moved_by_wheels_(expected.measured_m.has_value()),
      prior_(pose_prior(track, scan, stamp_s, expected)),
      judgement_(map, track, scan, stamp_s, expected, T_previous_start_) {}

ScanSearch::Found ScanSearch::near_start(double width_m) {
  const double gap_s = judgement_.gap_s();
  const bool is_gap = gap_s > TrackState::kSparse_s && gap_s <= TrackState::kLongestExtrapolation_s;
  from_start(width_m);
  if (judgement_.is_turn_known() && prior_ && !fixes_position(best_)) without_prior();
  if (track_.scans == 1 && !is_moved_by_wheels_) beside_a_start_in_motion(width_m);
  if (is_gap && !is_moved_by_wheels_ && width_m > fine_width_m(map_)) after_a_gap();
  return {best_, judgement_.fits(best_)};
}

// With an IMU that was right so far no turn is unforeseen.
ScanSearch::Found ScanSearch::around(const IcpResult& found) {
  best_ = found;
  if (!judgement_.is_turn_known()) turned_a_little();
  const IcpResult near = best_;
  if (!judgement_.is_turn_known()) turned_since_tracked();
  if (!judgement_.fits(best_) && judgement_.fits_beside_new(near)) return {near, true};
  return {best_, judgement_.fits(best_)};
}

void ScanSearch::from_start(double width_m) {
  best_ = align(width_m, T_previous_start_, prior_);
  if (!judgement_.is_possible(best_)) best_ = align(std::min(width_m, kNarrowSearch_m), T_previous_start_, prior_);
  // A push or a sudden turn back: without the prior, far more of what stands upright fits.
  if (prior_ && best_.matched_sideways < kDoubtful * track_.last_sideways)
    try_upright(kDoubtful, width_m, T_previous_start_);
}

// Where scans fix little, a wrong speed would lead past the right pose in scan after scan.
void ScanSearch::without_prior() {
  Pose T_still = T_previous_start_;
  T_still.translation().setZero();
  for (const Pose& T_from : {T_previous_start_, T_still}) take_if_more_upright(kDoubtful, align(kFarSearch_m, T_from));
}

// The second scan of a drive that began in motion: what was seen once fits, to some degree, where the sensor stands.
void ScanSearch::beside_a_start_in_motion(double width_m) {
  for (const double angle_deg : {0.0, 90.0, 180.0, 270.0}) {
    const double angle_rad = to_radians(angle_deg);
    const Pose T_beside =
        planar_pose(kStartInMotion_m * std::cos(angle_rad), kStartInMotion_m * std::sin(angle_rad), 0.0);
    try_upright(1.0, width_m, T_previous_start_ * T_beside);
  }
}

// Twice a second, or less: the next optimum need not be the right one, and the ground fits everywhere.
void ScanSearch::after_a_gap() {
  IcpResult best = best_;
  double most = judgement_.is_possible(best_)
                    ? kBetter * align_few(fine_width_m(map_), from_previous(best_)).matched_sideways
                    : 0.0;
  const auto compare_from = [&](const std::vector<Pose>& starts) {
    for (const Pose& T_from : starts) {
      const IcpResult tried = align_few(kFarSearch_m, T_from);
      if (tried.matched_sideways <= most || !judgement_.is_possible(tried)) continue;
      most = kBetter * tried.matched_sideways;
      best = align(fine_width_m(map_), from_previous(tried));
    }
  };
  const StartsInAGap starts = track_.scans == 1
                                  ? StartsInAGap::of_second_scan(judgement_.gap_s())
                                  : StartsInAGap::after(judgement_.gap_s(), T_previous_start_, track_.motion);
  compare_from(starts.likely);
  if (best.matched_sideways < kDoubtful * track_.last_sideways) compare_from(starts.unlikely);
  if (judgement_.is_possible(best) &&
      (best.matched_sideways > best_.matched_sideways || !judgement_.is_possible(best_)))
    best_ = best;
}

// A turn or a jolt that was not predicted, or the end of one. After a gap anything may fit somehow: nothing is tried.
void ScanSearch::turned_a_little() {
  for (const double turn_deg : kTurnsTried_deg) {
    if (turn_deg != 0.0 && !judgement_.follows()) break;
    try_turned(T_previous_start_, turn_deg);
    try_turned(Pose::Identity(), turn_deg);
  }
}

// The longer ago it was tracked, the farther may it have turned; the nearest heading that fits is the answer.
void ScanSearch::turned_since_tracked() {
  if (!judgement_.follows() || scan_.points.size() < kFewestToTurn) return;
  const Pose T_previous_tracked = track_.T_odom_lidar.inverse() * track_.T_odom_tracked;
  const double most_deg = std::min(180.0, kFastestTurn_degps * judgement_.untracked_s());
  for (double turn_deg = 0.0; turn_deg <= most_deg; turn_deg += kTurnStep_deg) {
    try_turned(T_previous_tracked, turn_deg);
    if (turn_deg > 0.0) try_turned(T_previous_tracked, -turn_deg);
  }
}

// With a few of the points; where these fit better, all are aligned.
void ScanSearch::try_turned(const Pose& T_previous_lidar, double turn_deg) {
  if (judgement_.fits(best_)) return;
  const IcpResult tried = align_few(kFarSearch_m, T_previous_lidar * planar_pose(0.0, 0.0, to_radians(turn_deg)));
  if (tried.matched <= most_of_few_) return;
  most_of_few_ = tried.matched;
  const IcpResult other = align(fine_width_m(map_), from_previous(tried));
  if (judgement_.fits(other) || other.matched > best_.matched) best_ = other;
}

// Of a scan of many points, a few of them first.
void ScanSearch::try_upright(double share, double width_m, const Pose& T_previous_lidar) {
  const bool has_many = scan_.points.size() >= 2 * kSettlesWith;
  if (!has_many || is_more_upright(share, align_few(width_m, T_previous_lidar)))
    take_if_more_upright(share, align(width_m, T_previous_lidar));
}

void ScanSearch::take_if_more_upright(double share, const IcpResult& other) {
  if (is_more_upright(share, other)) best_ = other;
}

bool ScanSearch::is_more_upright(double share, const IcpResult& other) const {
  return share * other.matched_sideways > best_.matched_sideways && judgement_.is_possible(other);
}

IcpResult ScanSearch::align(double width_m, const Pose& T_previous_lidar, const std::optional<PosePrior>& prior) const {
  return align_points(scan_.points, width_m, T_previous_lidar, prior);
}

IcpResult ScanSearch::align_points(std::span<const Eigen::Vector3f> points, double width_m,
                                   const Pose& T_previous_lidar, const std::optional<PosePrior>& prior) const {
  IcpResult icp = align_icp(map_, points, track_.T_odom_lidar * T_previous_lidar,
                            {.coarse_m = width_m,
                             .fine_m = std::min(width_m, fine_width_m(map_)),
                             .least_reach_m = map_.voxel_m(),
                             .settled_m = kSettled_m,
                             .settles_with = kSettlesWith,
                             .least_seen = kLeastSeen,
                             .level_deg = level_deg(track_.rings),
                             .noise_m = track_.rings > 0 ? kNoise_m : 0.0,
                             .prior = prior});
  icp.converged = icp.converged || (icp.information(0, 0) > 0.0 && icp.last_step_m < kSteady_m);
  return icp;
}

IcpResult ScanSearch::align_few(double width_m, const Pose& T_previous_lidar) {
  if (few_.empty())
    for (std::size_t i = 0; i < scan_.points.size(); i += 1 + scan_.points.size() / (2 * kFew))
      few_.push_back(scan_.points[i]);
  return align_points(few_, width_m, T_previous_lidar, {});
}

}  // namespace revisit
