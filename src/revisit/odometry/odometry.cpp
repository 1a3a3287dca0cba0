// SPDX-License-Identifier: Apache-2.0
#include <revisit/odometry/odometry.hpp>

#include <algorithm>
#include <cmath>
#include <vector>

#include <revisit/registration/icp.hpp>
#include <revisit/registration/surface_cloud.hpp>

namespace revisit {
namespace {

constexpr double kPartsOfAVoxel = 2.0;                      // along an edge: points that the map is given
constexpr double kReach_m = 100.0;                          // of the map
constexpr double kForget = 0.1;                             // share of the newest in a running mean
constexpr double kFarSearch_m = 2.0;                        // where little is known of the motion
constexpr double kFewestMatched = 0.3, kUsualSpread = 0.2;  // of a scan's points
constexpr double kLeastSeen = 1e-3;                         // a point in a thousand that faces a direction
constexpr double kLongestGuess_s = 5.0;
constexpr double kLongestGap_s = 1.0;  // beyond, the motion before says nothing about the motion now

double median_range_m(std::span<const Point> points) {
  std::vector<float> ranges;
  ranges.reserve(points.size());
  for (const Point& p : points) ranges.push_back(std::hypot(p.x, p.y, p.z));
  if (ranges.empty()) return 10.0;
  const auto middle = ranges.begin() + static_cast<std::ptrdiff_t>(ranges.size() / 2);
  std::nth_element(ranges.begin(), middle, ranges.end());
  return static_cast<double>(*middle);
}

std::vector<Eigen::Vector3f> in_map(const std::vector<Eigen::Vector3f>& points, const Pose& T_odom_lidar) {
  std::vector<Eigen::Vector3f> moved(points.size());
  const Eigen::Isometry3f T = T_odom_lidar.cast<float>();
  std::transform(points.begin(), points.end(), moved.begin(), [&](const Eigen::Vector3f& p) { return T * p; });
  return moved;
}

}  // namespace

std::optional<Twist> Odometry::expected(double stamp_s) const {
  const double gap_s = stamp_s - last_stamp_s_;
  return gap_s > 0.0 && gap_s <= kLongestGap_s ? motion_ : std::nullopt;
}

OdometryScan Odometry::thinned(std::span<const Point> points) const {
  OdometryScan scan;
  scan.range_m = map_ ? range_m_ : median_range_m(points);
  constexpr double kVoxelsToTheMedian = 12.0, kSmallest_m = 0.25, kLargest_m = 1.0;
  scan.voxel_m = map_ ? map_->voxel_m() : std::clamp(scan.range_m / kVoxelsToTheMedian, kSmallest_m, kLargest_m);
  scan.map_points = thin_surfaces(points, {}, scan.voxel_m / kPartsOfAVoxel).points;
  std::vector<Point> thinned_once;
  thinned_once.reserve(scan.map_points.size());
  for (const Eigen::Vector3f& p : scan.map_points) thinned_once.push_back({p.x(), p.y(), p.z(), 0.f});
  scan.points = thin_surfaces(thinned_once, {}, scan.voxel_m).points;
  return scan;
}

double Odometry::search_radius_m() const {
  constexpr double kLeastVoxels = 1.0, kSigmas = 3.0;
  constexpr int kScansToLearn = 10;
  if (scans_ < kScansToLearn) return kFarSearch_m;
  return std::clamp(kSigmas * std::sqrt(squared_surprise_m2_), kLeastVoxels * map_->voxel_m(), kFarSearch_m);
}

bool Odometry::is_believed(double matched, double met) const {
  // The first scans of a sparse sensor meet few surfaces; those that they meet must fit.
  constexpr int kFirst_scans = 5;
  constexpr double kFewestAtFirst = 0.1, kFittingAtFirst = 0.6;
  if (scans_ < kFirst_scans) return matched >= kFewestAtFirst && matched >= kFittingAtFirst * met;
  return matched >= std::max(kFewestMatched, usual_match_ - kUsualSpread);
}

OdometryStep Odometry::find(double stamp_s, const OdometryScan& scan, const std::optional<Pose>& T_before_now) const {
  OdometryStep step;
  step.T_odom_lidar = T_odom_lidar_;
  // Over a gap the motion before is a poor guess, and still a better one than none.
  const double gap_s = stamp_s - last_stamp_s_;
  const bool goes_on = motion_ && gap_s > 0.0 && gap_s <= kLongestGuess_s;
  const Pose T_moved = T_before_now ? *T_before_now : goes_on ? motion_after(*motion_, gap_s) : Pose::Identity();
  if (!map_) {
    step.T_before_now = step.T_before_found = T_moved;
    step.T_odom_lidar = T_odom_lidar_ * T_moved;
    step.is_tracked = true;  // wherever it is: there the map begins
    return step;
  }
  const double voxel_m = map_->voxel_m();
  const auto align = [&](double radius_m, const Pose& T_guess) {
    IcpResult icp = align_icp(*map_, scan.points, T_odom_lidar_ * T_guess,
                              {.coarse_m = radius_m,
                               .fine_m = std::min(radius_m, 0.3 * voxel_m + 0.1),
                               .least_reach_m = voxel_m,
                               .settled_m = 2e-3,
                               .least_seen = kLeastSeen});
    constexpr double kSteady_m = 0.02;  // rocking between two voxels
    icp.converged = icp.converged || (icp.information(0, 0) > 0.0 && icp.last_step_m < kSteady_m);
    return icp;
  };
  const auto fits = [&](const IcpResult& icp) { return icp.converged && is_believed(icp.matched, icp.met); };
  IcpResult icp = align(search_radius_m(), T_moved);
  // A turn or a jolt that was not foreseen, or the end of one. After a gap anything may fit somehow: nothing is tried.
  const bool follows = gap_s > 0.0 && gap_s <= kLongestGap_s;
  for (const double turn_deg : {0.0, 5.0, -5.0, 10.0, -10.0})
    for (const Pose& T_guess : {T_moved, Pose(Pose::Identity())}) {
      if (fits(icp) || (turn_deg != 0.0 && !follows)) break;
      const IcpResult other = align(kFarSearch_m, T_guess * planar_pose(0.0, 0.0, to_radians(turn_deg)));
      if (fits(other) || other.matched > icp.matched) icp = other;
    }
  step.matched = icp.matched;
  step.met = icp.met;
  step.is_tracked = fits(icp);
  step.T_before_now = T_moved;
  step.T_odom_lidar = T_odom_lidar_ * T_moved;
  step.T_before_found = T_odom_lidar_.inverse() * icp.T_target_source;
  const Pose surprise = T_moved.inverse() * step.T_before_found;
  step.surprise_m = surprise.translation().norm() + rotation_angle(surprise) * range_m_;
  if (step.is_tracked) {
    step.T_odom_lidar = icp.T_target_source;
    step.T_before_now = step.T_before_found;
    step.information = icp.information;
  }
  // Poses are made from poses scan after scan: what rounding does to a rotation must not build up.
  step.T_odom_lidar.linear() = Eigen::Quaterniond(step.T_odom_lidar.linear()).normalized().toRotationMatrix();
  return step;
}

void Odometry::accept(double stamp_s, const OdometryScan& scan, const OdometryStep& step) {
  const double gap_s = stamp_s - last_stamp_s_;
  if (!map_) {
    range_m_ = scan.range_m;
    map_.emplace(scan.voxel_m, kReach_m);
  } else {
    const double share = std::max(kForget, 1.0 / scans_);
    if (step.is_tracked) {
      squared_surprise_m2_ += share * (step.surprise_m * step.surprise_m - squared_surprise_m2_);
      usual_match_ += share * (step.matched - usual_match_);
    }
    motion_.reset();
    if (gap_s > 0.0 && gap_s <= kLongestGap_s) motion_ = twist_of(step.T_before_now, gap_s);
  }
  T_odom_lidar_ = step.T_odom_lidar;
  if (step.is_tracked) map_->add(in_map(scan.map_points, T_odom_lidar_));
  constexpr float kForgetEvery_m = 5.f;
  if (const Eigen::Vector3f here = T_odom_lidar_.translation().cast<float>();
      (here - forgotten_from_).norm() > kForgetEvery_m) {
    map_->forget_far_from(here);
    forgotten_from_ = here;
  }
  last_stamp_s_ = stamp_s;
  ++scans_;
}

void Odometry::restart() {
  map_.reset();
  motion_.reset();
  squared_surprise_m2_ = usual_match_ = 0.0;
  scans_ = 0;
}

void Odometry::stand_at(double stamp_s, const Pose& T_odom_lidar, const std::optional<Twist>& motion) {
  last_stamp_s_ = stamp_s;
  T_odom_lidar_ = T_odom_lidar;
  motion_ = motion;
  // How usual scans match is to be learnt again.
  squared_surprise_m2_ = usual_match_ = 0.0;
  scans_ = 1;
}

OdometryStep Odometry::track(double stamp_s, std::span<const Point> points, const std::optional<Pose>& T_before_now) {
  const OdometryScan scan = thinned(points);
  OdometryStep step = find(stamp_s, scan, T_before_now);
  accept(stamp_s, scan, step);
  return step;
}

}  // namespace revisit
