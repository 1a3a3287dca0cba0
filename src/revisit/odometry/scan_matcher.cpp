// SPDX-License-Identifier: Apache-2.0
#include <revisit/odometry/scan_matcher.hpp>

#include <algorithm>
#include <cmath>
#include <vector>

#include <oneapi/tbb/task_arena.h>
#include <oneapi/tbb/task_group.h>

#include <revisit/odometry/scan_search.hpp>
#include <revisit/registration/surface_cloud.hpp>

namespace revisit {
namespace {

// Edge of the map's voxels: voxels to the median range, and its bounds.
constexpr double kVoxelsToTheMedian = 12.0, kSmallestVoxel_m = 0.25, kLargestVoxel_m = 1.0;
constexpr double kPointsAlongAVoxel = 2.0;  // that the map is given
constexpr double kMapReach_m = 100.0;
constexpr float kForgetEvery_m = 5.f;  // what lies beyond the reach
constexpr double kWidestSearch_m = 2.0;
constexpr double kSigmas = 3.0;  // of the prediction error that are searched

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

// Scans enter the map while the next is prepared. In an arena of its own: the caller's may be left before the work is
// done, and from outside nobody works in it.
class ScanMatcher::Insertion {
 public:
  Insertion() = default;
  Insertion(const Insertion&) = delete;
  Insertion& operator=(const Insertion&) = delete;
  ~Insertion() { wait(); }

  template <typename Work>
  void run(Work work) {
    arena_.execute([&] { tasks_.run(std::move(work)); });
  }
  void wait() {
    arena_.execute([&] { tasks_.wait(); });
  }

 private:
  tbb::task_arena arena_{2};  // whoever waits, and one more
  tbb::task_group tasks_;
};

ScanMatcher::ScanMatcher() : insertion_(std::make_unique<Insertion>()) {}
ScanMatcher::~ScanMatcher() = default;
ScanMatcher::ScanMatcher(ScanMatcher&&) noexcept = default;
ScanMatcher& ScanMatcher::operator=(ScanMatcher&&) noexcept = default;

void ScanMatcher::wait() const { insertion_->wait(); }

std::optional<Twist> ScanMatcher::predicted_motion(double stamp_s) const {
  const double gap_s = stamp_s - track_.last_stamp_s;
  return gap_s > 0.0 && gap_s <= TrackState::kLongestGap_s ? track_.motion : std::nullopt;
}

MatcherScan ScanMatcher::thinned(std::span<const Point> points) const {
  MatcherScan scan;
  scan.range_m = map_ ? track_.range_m : median_range_m(points);
  scan.voxel_m =
      map_ ? map_->voxel_m() : std::clamp(scan.range_m / kVoxelsToTheMedian, kSmallestVoxel_m, kLargestVoxel_m);
  scan.map_points = thin_surfaces(points, {}, scan.voxel_m / kPointsAlongAVoxel).points;
  std::vector<Point> thinned_once;
  thinned_once.reserve(scan.map_points.size());
  for (const Eigen::Vector3f& p : scan.map_points) thinned_once.push_back({p.x(), p.y(), p.z(), 0.f});
  scan.points = thin_surfaces(thinned_once, {}, scan.voxel_m).points;
  return scan;
}

double ScanMatcher::search_width_m() const {
  if (track_.scans < TrackState::kScansToLearn) return kWidestSearch_m;
  return std::clamp(kSigmas * std::sqrt(track_.squared_prediction_error_m2), map_->voxel_m(), kWidestSearch_m);
}

ScanMatch ScanMatcher::match(double stamp_s, const MatcherScan& scan, const std::optional<MotionGuess>& guess) const {
  using Measured = MotionGuess::Measured;
  const double gap_s = stamp_s - track_.last_stamp_s;
  ScanMatch expected;
  if (guess) {
    expected.T_previous_predicted = guess->T_previous_lidar;
    if (guess->measured == Measured::kAll) expected.measured_m = guess->T_previous_lidar.translation().norm();
    // A sensor of rings was followed less well with it (docs/slam.md).
    expected.is_turn_measured = guess->measured == Measured::kTurn && track_.rings == 0;
  } else if (track_.motion && gap_s > 0.0 && gap_s <= TrackState::kLongestExtrapolation_s) {
    expected.T_previous_predicted = motion_after(*track_.motion, gap_s);
  }
  expected.T_previous_start = expected.T_previous_predicted;
  return match_from(map_ ? search_width_m() : 0.0, stamp_s, scan, expected);
}

ScanMatch ScanMatcher::match_again(double stamp_s, const MatcherScan& scan, const ScanMatch& match) const {
  ScanMatch expected = match;
  expected.T_previous_start = match.T_previous_found;
  return match_from(map_ ? fine_width_m(*map_) : 0.0, stamp_s, scan, expected);
}

ScanMatch ScanMatcher::look_around(double stamp_s, const MatcherScan& scan, const ScanMatch& match) const {
  wait();
  const auto [icp, is_tracked] = ScanSearch(*map_, track_, scan, stamp_s, match).around(match.icp);
  return match_at(icp, is_tracked, match);
}

ScanMatch ScanMatcher::match_from(double width_m, double stamp_s, const MatcherScan& scan,
                                  const ScanMatch& expected) const {
  if (!map_) {
    IcpResult at_start;
    at_start.T_target_source = track_.T_odom_lidar * expected.T_previous_start;
    return match_at(at_start, true, expected);  // the map begins wherever it is
  }
  wait();
  const auto [icp, is_tracked] = ScanSearch(*map_, track_, scan, stamp_s, expected).near_start(width_m);
  return match_at(icp, is_tracked, expected);
}

ScanMatch ScanMatcher::match_at(const IcpResult& icp, bool is_tracked, const ScanMatch& expected) const {
  ScanMatch match = expected;
  match.icp = icp;
  match.is_tracked = is_tracked;
  match.T_previous_found = track_.T_odom_lidar.inverse() * icp.T_target_source;
  match.T_previous_lidar = is_tracked ? match.T_previous_found : match.T_previous_start;
  match.T_odom_lidar = normalised(track_.T_odom_lidar * match.T_previous_lidar);
  match.information = is_tracked ? icp.information : Matrix6::Zero();
  const Pose error = match.T_previous_start.inverse() * match.T_previous_found;
  match.prediction_error_m = error.translation().norm() + rotation_angle(error) * track_.range_m;
  return match;
}

void ScanMatcher::accept(double stamp_s, const MatcherScan& scan, const ScanMatch& match) {
  track_.advance(stamp_s, scan, match);
  if (!map_) map_ = std::make_unique<LocalMap>(scan.voxel_m, kMapReach_m);
  const Eigen::Vector3f here = track_.T_odom_lidar.translation().cast<float>();
  const bool forgets = (here - forgotten_from_).norm() > kForgetEvery_m;
  if (forgets) forgotten_from_ = here;
  wait();
  insertion_->run(
      [map = map_.get(), forgets, here,
       points = match.is_tracked ? in_map(scan.map_points, track_.T_odom_lidar) : std::vector<Eigen::Vector3f>()] {
        map->add(points);
        if (forgets) map->forget_far_from(here);
      });
}

void ScanMatcher::restart() {
  wait();
  map_.reset();
  track_.restart();
}

}  // namespace revisit
