// SPDX-License-Identifier: Apache-2.0
#include <revisit/odometry/scan_matcher.hpp>

#include <algorithm>
#include <cmath>
#include <vector>

#include <oneapi/tbb/task_arena.h>
#include <oneapi/tbb/task_group.h>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include <revisit/odometry/motion_limits.hpp>
#include <revisit/odometry/starts_in_a_gap.hpp>
#include <revisit/registration/surface_cloud.hpp>

namespace revisit {
namespace {

// Chosen on simulated drives and KITTI raw 0005 (docs/slam.md, docs/history.md).
struct Matching {
  // Edge of the map's voxels: voxels to the median range, and its bounds.
  static constexpr double kVoxelsToTheMedian = 12.0, kSmallestVoxel_m = 0.25, kLargestVoxel_m = 1.0;
  static constexpr double kPointsAlongAVoxel = 2.0;  ///< that the map is given
  static constexpr double kMapReach_m = 100.0;
  static constexpr float kForgetEvery_m = 5.f;  ///< what lies beyond the reach
  static constexpr double kNewShare = 0.1;      ///< of the newest scan in a running mean

  static constexpr int kScansToLearn = 10;     ///< before the search radius follows the prediction error
  static constexpr double kFarSearch_m = 2.0;  ///< until then, and where the prediction failed
  static constexpr double kSigmas = 3.0;       ///< of the prediction error that are searched
  static constexpr double kSettled_m = 2e-3;
  static constexpr double kLeastSeen = 1e-3;  ///< a point in a thousand that faces a direction (IcpOptions)
  static constexpr double kSteady_m = 0.02;   ///< rocking between two voxels counts as converged
  static constexpr double kNoise_m = 0.03;    ///< of points, where patches count by their variance
  // What faces the axis of rings, to within so much, fixes nothing across it. The lines of few rings lie on no surface
  // together: in crowns their planes lean as the beams do.
  static constexpr double kLevel_deg = 8.0, kLevelOfFew_deg = 20.0;
  static constexpr std::uint32_t kFewRings = 32;
  static constexpr double kFineVoxels = 0.3, kFine_m = 0.1;  ///< narrowest kernel: so many voxels and so much more
  static constexpr double kTurnsTried_deg[] = {0.0, 5.0, -5.0, 10.0, -10.0};  ///< where the prediction failed
  static constexpr double kFastestTurn_degps = 300.0, kTurnStep_deg = 15.0;   ///< since the last scan that was tracked
  static constexpr std::size_t kFewestToTurn = 300;                           ///< points: fewer fit at many headings
  static constexpr std::size_t kFew = 1000;  ///< points of a scan, about, with which these are tried

  static constexpr double kFewestMatched = 0.3;     ///< share of the points of a scan that is tracked
  static constexpr double kBelowTypical = 0.2;      ///< what it may fall below the running mean
  static constexpr double kBelowUnpredicted = 0.1;  ///< the same, where nothing says what was driven since
  static constexpr double kOfTypical = 0.7;         ///< share of a running mean that is low itself, of a sparse sensor
  // Share of what the last tracked scan had on upright surfaces: the ground fits wherever the sensor went. Right steps
  // have .35 and more of it, the first wrong ones of cars whose turn ended between two scans .06 to .08.
  static constexpr double kLeastOfLastSideways = 0.3;
  static constexpr double kMostSlip = 0.6, kSlip_m = 0.1;   ///< of what wheels measure, and so much more
  static constexpr double kWheels_m = 0.02, kWheels = 0.1;  ///< standard deviation of what they measure
  static constexpr double kFixed_m = 0.04;                  ///< a position that scans fix, a standard deviation
  static constexpr double kNarrowSearch_m = 0.3;            ///< where a wide search found what cannot be
  // The first scans of a sparse sensor meet few surfaces; those that they meet must fit.
  static constexpr int kFirstScans = 5;
  static constexpr double kStart_m = 1.0;  ///< tried on every side
  static constexpr double kFewestMatchedAtFirst = 0.1, kFittingAtFirst = 0.6;
  // Beside what is new: share of all points, and of those that meet something (less where an IMU is trusted); and share
  // of all that was seen through.
  static constexpr double kFewestBesideNew = 0.15, kFittingBesideNew = 0.7, kFittingAsForeseen = 0.5,
                          kMostContradicted = 0.06;

  // A gap after which a prediction is no more than a guess. Another pose counts where so much more lies on what is
  // upright; one with less than so much of what the last scan had there is doubtful.
  static constexpr double kSparse_s = 0.25, kBetter = 1.1, kDoubtful = 0.7;
  static constexpr double kLongestAssumed = 5.0;  ///< that times may be apart, of what is assumed where there are none
  static constexpr double kLongestGap_s = 2.0;    ///< beyond, the motion before says nothing about the motion now
  static constexpr double kLongestExtrapolation_s = 5.0;  ///< and is still a better guess than none
};

double level_deg(std::uint32_t rings) {
  if (rings == 0) return 0.0;
  return rings <= Matching::kFewRings ? Matching::kLevelOfFew_deg : Matching::kLevel_deg;
}

double median_range_m(std::span<const Point> points) {
  std::vector<float> ranges;
  ranges.reserve(points.size());
  for (const Point& p : points) ranges.push_back(std::hypot(p.x, p.y, p.z));
  if (ranges.empty()) return 10.0;
  const auto middle = ranges.begin() + static_cast<std::ptrdiff_t>(ranges.size() / 2);
  std::nth_element(ranges.begin(), middle, ranges.end());
  return static_cast<double>(*middle);
}

// Whether the scan by itself tells the position in every direction.
bool fixes_position(const IcpResult& icp) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(icp.position_information, Eigen::EigenvaluesOnly);
  return axes.eigenvalues()(0) * Matching::kFixed_m * Matching::kFixed_m >= 1.0;
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
  const double gap_s = stamp_s - last_stamp_s_;
  return gap_s > 0.0 && gap_s <= Matching::kLongestGap_s ? motion_ : std::nullopt;
}

MatcherScan ScanMatcher::thinned(std::span<const Point> points) const {
  MatcherScan scan;
  scan.range_m = map_ ? range_m_ : median_range_m(points);
  scan.voxel_m = map_ ? map_->voxel_m()
                      : std::clamp(scan.range_m / Matching::kVoxelsToTheMedian, Matching::kSmallestVoxel_m,
                                   Matching::kLargestVoxel_m);
  scan.map_points = thin_surfaces(points, {}, scan.voxel_m / Matching::kPointsAlongAVoxel).points;
  std::vector<Point> thinned_once;
  thinned_once.reserve(scan.map_points.size());
  for (const Eigen::Vector3f& p : scan.map_points) thinned_once.push_back({p.x(), p.y(), p.z(), 0.f});
  scan.points = thin_surfaces(thinned_once, {}, scan.voxel_m).points;
  return scan;
}

double ScanMatcher::fine_m() const { return Matching::kFineVoxels * map_->voxel_m() + Matching::kFine_m; }

double ScanMatcher::search_radius_m() const {
  if (scans_ < Matching::kScansToLearn) return Matching::kFarSearch_m;
  return std::clamp(Matching::kSigmas * std::sqrt(squared_prediction_error_m2_), map_->voxel_m(),
                    Matching::kFarSearch_m);
}

bool ScanMatcher::is_credible(const IcpResult& icp, bool is_predicted) const {
  if (icp.matched_sideways < Matching::kLeastOfLastSideways * last_sideways_) return false;
  if (is_predicted && scans_ < Matching::kFirstScans)
    return icp.matched >= Matching::kFewestMatchedAtFirst && icp.matched >= Matching::kFittingAtFirst * icp.met;
  return icp.matched >=
         std::max(std::min(Matching::kFewestMatched, Matching::kOfTypical * typical_match_),
                  typical_match_ - (is_predicted ? Matching::kBelowTypical : Matching::kBelowUnpredicted));
}

ScanMatch ScanMatcher::match(double stamp_s, const MatcherScan& scan, const std::optional<MotionGuess>& guess,
                             Search search) const {
  using Measured = MotionGuess::Measured;
  const double gap_s = stamp_s - last_stamp_s_;
  ScanMatch predicted;
  if (guess) {
    predicted.T_previous_predicted = guess->T_previous_lidar;
    if (guess->measured == Measured::kAll) predicted.measured_m = guess->T_previous_lidar.translation().norm();
    // A sensor of rings was followed less well with it (docs/slam.md).
    predicted.is_turn_measured = guess->measured == Measured::kTurn && rings_ == 0;
  } else if (motion_ && gap_s > 0.0 && gap_s <= Matching::kLongestExtrapolation_s) {
    predicted.T_previous_predicted = motion_after(*motion_, gap_s);
  }
  return match_within(map_ ? search_radius_m() : 0.0, stamp_s, scan, predicted, predicted.T_previous_predicted, search);
}

ScanMatch ScanMatcher::match_again(double stamp_s, const MatcherScan& scan, const ScanMatch& match,
                                   Search search) const {
  return match_within(map_ ? fine_m() : 0.0, stamp_s, scan, match, match.T_previous_found, search);
}

// Where few surfaces fix the pose, how the sensor moved so far tells more of its position, and an IMU of its rotation.
std::optional<PosePrior> ScanMatcher::prior_at(double stamp_s, const MatcherScan& scan,
                                               const ScanMatch& predicted) const {
  PosePrior prior;
  prior.T_target_source = T_odom_lidar_ * predicted.T_previous_predicted;
  prior.position_information = position_information_at(stamp_s, scan, predicted);
  if (predicted.is_turn_measured) {
    const double off_rad = imu_trust_.stddev_rad();
    prior.rotation_information = Eigen::Matrix3d::Identity() / (off_rad * off_rad);
  }
  if (prior.position_information.isZero() && prior.rotation_information.isZero()) return std::nullopt;
  return prior;
}

// Along the map's axes; zero where nothing is known.
Eigen::Matrix3d ScanMatcher::position_information_at(double stamp_s, const MatcherScan& scan,
                                                     const ScanMatch& predicted) const {
  const double gap_s = stamp_s - last_stamp_s_;
  if (predicted.measured_m) {
    const double off_m = Matching::kWheels_m + Matching::kWheels * *predicted.measured_m;
    return Eigen::Matrix3d::Identity() / (off_m * off_m);
  }
  // A start that was not tracked is often misjudged at first, and its speed with it.
  const bool is_misjudged = start_was_untracked_ && scans_ < Matching::kScansToLearn;
  if (!motion_ || is_misjudged || scan.is_stamp_assumed || gap_s <= 0.0 || gap_s > Matching::kSparse_s)
    return Eigen::Matrix3d::Zero();
  const Eigen::Matrix3d turn = predicted.T_previous_predicted.linear(), R = T_odom_lidar_.linear() * turn;
  return R * velocity_.covariance_after(gap_s, turn).inverse() * R.transpose();
}

ScanMatch ScanMatcher::match_within(double radius_m, double stamp_s, const MatcherScan& scan,
                                    const ScanMatch& predicted, const Pose& T_start, Search search) const {
  const std::optional<double> measured_m = predicted.measured_m;
  ScanMatch match;
  match.measured_m = measured_m;
  match.is_turn_measured = predicted.is_turn_measured;
  match.T_previous_predicted = predicted.T_previous_predicted;
  match.T_previous_lidar = match.T_previous_found = T_start;
  match.T_odom_lidar = normalised(T_odom_lidar_ * T_start);
  if (!map_) {
    match.is_tracked = true;  // the map begins wherever it is
    return match;
  }
  wait();
  const auto align_points = [&](std::span<const Eigen::Vector3f> points, double width_m, const Pose& T_from,
                                const std::optional<PosePrior>& prior = {}) {
    IcpResult icp = align_icp(*map_, points, T_odom_lidar_ * T_from,
                              {.coarse_m = width_m,
                               .fine_m = std::min(width_m, fine_m()),
                               .least_reach_m = map_->voxel_m(),
                               .settled_m = Matching::kSettled_m,
                               .least_seen = Matching::kLeastSeen,
                               .level_deg = level_deg(rings_),
                               .noise_m = rings_ > 0 ? Matching::kNoise_m : 0.0,
                               .prior = prior});
    icp.converged = icp.converged || (icp.information(0, 0) > 0.0 && icp.last_step_m < Matching::kSteady_m);
    return icp;
  };
  const auto align = [&](double width_m, const Pose& T_from) { return align_points(scan.points, width_m, T_from); };
  const double gap_s = stamp_s - last_stamp_s_;
  const bool follows = gap_s > 0.0 && gap_s <= Matching::kLongestGap_s;
  // Since the last scan that was tracked: the longer ago, the farther may the sensor be from where it was predicted.
  const double untracked_s = (stamp_s - tracked_stamp_s_) * (scan.is_stamp_assumed ? Matching::kLongestAssumed : 1.0);
  const MotionLimits limits(T_odom_lidar_ * T_start, untracked_s);
  const auto prior = prior_at(stamp_s, scan, predicted);
  const auto is_possible = [&](const IcpResult& icp) {
    // Wheels slip, but not like this: it is the surroundings that move along with the sensor.
    const double found_m = (T_odom_tracked_.inverse() * icp.T_target_source).translation().norm();
    const double wheels_m = untracked_m_ + measured_m.value_or(0.0);
    if (measured_m && wheels_m - found_m > Matching::kSlip_m + Matching::kMostSlip * wheels_m) return false;
    return !motion_ || gap_s <= 0.0 || !limits.slides(icp);
  };
  const bool is_predicted = measured_m || untracked_s <= Matching::kLongestExtrapolation_s;
  // With an IMU that was right so far no turn is unforeseen, and nothing is looked for elsewhere.
  const bool is_turn_known = predicted.is_turn_measured && imu_trust_.is_trusted();
  const double fitting = is_turn_known ? Matching::kFittingAsForeseen : Matching::kFittingBesideNew;
  // A narrow sensor that turns, or one that comes round a corner, sees mostly what is new: of the rest, most must fit.
  const auto fits_beside_new = [&](const IcpResult& icp) {
    if (scans_ < Matching::kFirstScans || !is_predicted || !icp.converged || !is_possible(icp) ||
        !limits.is_near(icp) || icp.matched < std::max(Matching::kFewestBesideNew, fitting * icp.met))
      return false;
    return last_view_.contradicted(*map_, scan.points, icp.T_target_source, std::max(fine_m(), map_->voxel_m())) <=
           Matching::kMostContradicted;
  };
  const auto fits = [&](const IcpResult& icp) {
    return icp.converged && is_possible(icp) && is_credible(icp, is_predicted);
  };
  IcpResult icp = align_points(scan.points, radius_m, T_start, prior);
  if (!is_possible(icp)) icp = align_points(scan.points, std::min(radius_m, Matching::kNarrowSearch_m), T_start, prior);
  // A push or a sudden turn back: without the prior, far more of what stands upright fits.
  if (prior && icp.matched_sideways < Matching::kDoubtful * last_sideways_) {
    const IcpResult alone = align(radius_m, T_start);
    if (alone.matched_sideways * Matching::kDoubtful > icp.matched_sideways && is_possible(alone)) icp = alone;
  }
  // Where scans fix little, a wrong speed would lead past the right pose in scan after scan.
  if (is_turn_known && prior && !fixes_position(icp)) {
    Pose T_still = T_start;
    T_still.translation().setZero();
    for (const Pose& T_from : {T_start, T_still}) {
      const IcpResult alone = align(Matching::kFarSearch_m, T_from);
      if (alone.matched_sideways * Matching::kDoubtful > icp.matched_sideways && is_possible(alone)) icp = alone;
    }
  }
  // The second scan of a drive that began in motion: what was seen once fits, to some degree, where the sensor stands.
  if (scans_ == 1 && !measured_m)
    for (const double angle_deg : {0.0, 90.0, 180.0, 270.0}) {
      const double angle_rad = to_radians(angle_deg);
      const IcpResult other = align(radius_m, T_start * planar_pose(Matching::kStart_m * std::cos(angle_rad),
                                                                    Matching::kStart_m * std::sin(angle_rad), 0.0));
      if (other.matched_sideways > icp.matched_sideways && is_possible(other)) icp = other;
    }
  std::vector<Eigen::Vector3f> few;
  const auto align_few = [&](double width_m, const Pose& T_from) {
    if (few.empty())
      for (std::size_t i = 0; i < scan.points.size(); i += 1 + scan.points.size() / (2 * Matching::kFew))
        few.push_back(scan.points[i]);
    return align_points(few, width_m, T_from);
  };
  const auto seen_from = [&](const IcpResult& found) { return T_odom_lidar_.inverse() * found.T_target_source; };
  // Twice a second, or less: the next optimum need not be the right one, and the ground fits everywhere.
  if (!measured_m && gap_s > Matching::kSparse_s && gap_s <= Matching::kLongestExtrapolation_s && radius_m > fine_m()) {
    IcpResult best = icp;
    double most = is_possible(icp) ? Matching::kBetter * align_few(fine_m(), seen_from(icp)).matched_sideways : 0.0;
    const auto compare_from = [&](const std::vector<Pose>& starts) {
      for (const Pose& T_from : starts) {
        const IcpResult tried = align_few(Matching::kFarSearch_m, T_from);
        if (tried.matched_sideways <= most || !is_possible(tried)) continue;
        most = Matching::kBetter * tried.matched_sideways;
        best = align(fine_m(), seen_from(tried));
      }
    };
    const StartsInAGap starts =
        scans_ == 1 ? StartsInAGap::of_second_scan(gap_s) : StartsInAGap::after(gap_s, T_start, motion_);
    compare_from(starts.likely);
    if (best.matched_sideways < Matching::kDoubtful * last_sideways_) compare_from(starts.unlikely);
    if (is_possible(best) && (best.matched_sideways > icp.matched_sideways || !is_possible(icp))) icp = best;
  }
  // A turn or a jolt that was not predicted, or the end of one. After a gap anything may fit somehow: nothing is tried.
  // With a few of the points; where these fit better, all are aligned.
  double best_of_few = 0.0;
  const auto try_from = [&](const Pose& T_tried, double turn_deg) {
    if (search == Search::kThere || is_turn_known || fits(icp)) return;
    const IcpResult tried = align_few(Matching::kFarSearch_m, T_tried * planar_pose(0.0, 0.0, to_radians(turn_deg)));
    if (tried.matched <= best_of_few) return;
    best_of_few = tried.matched;
    const IcpResult other = align(fine_m(), seen_from(tried));
    if (fits(other) || other.matched > icp.matched) icp = other;
  };
  const Pose T_tracked = T_odom_lidar_.inverse() * T_odom_tracked_;
  for (const double turn_deg : Matching::kTurnsTried_deg) {
    if (turn_deg != 0.0 && !follows) break;
    try_from(T_start, turn_deg);
    try_from(Pose::Identity(), turn_deg);
  }
  const IcpResult near = icp;
  // The longer ago it was tracked, the farther may it have turned; the nearest heading that fits is the answer.
  const double most_deg = std::min(180.0, Matching::kFastestTurn_degps * untracked_s);
  for (double turn_deg = 0.0; follows && scan.points.size() >= Matching::kFewestToTurn && turn_deg <= most_deg;
       turn_deg += Matching::kTurnStep_deg) {
    try_from(T_tracked, turn_deg);
    if (turn_deg > 0.0) try_from(T_tracked, -turn_deg);
  }
  bool is_tracked = fits(icp);
  if (!is_tracked && search == Search::kAround && fits_beside_new(near)) {
    icp = near;
    is_tracked = true;
  }
  match.matched = icp.matched;
  match.matched_sideways = icp.matched_sideways;
  match.met = icp.met;
  match.is_tracked = is_tracked;
  match.T_previous_found = T_odom_lidar_.inverse() * icp.T_target_source;
  const Pose error = T_start.inverse() * match.T_previous_found;
  match.prediction_error_m = error.translation().norm() + rotation_angle(error) * range_m_;
  if (match.is_tracked) {
    match.T_odom_lidar = normalised(icp.T_target_source);
    match.T_previous_lidar = match.T_previous_found;
    match.information = icp.information;
    match.position_information = icp.position_information;
  }
  return match;
}

void ScanMatcher::accept(double stamp_s, const MatcherScan& scan, const ScanMatch& match) {
  const double gap_s = stamp_s - last_stamp_s_;
  if (!map_) {
    range_m_ = scan.range_m;
    map_ = std::make_unique<LocalMap>(scan.voxel_m, Matching::kMapReach_m);
  } else {
    const double share = std::max(Matching::kNewShare, 1.0 / scans_);
    if (match.is_tracked) {
      squared_prediction_error_m2_ +=
          share * (match.prediction_error_m * match.prediction_error_m - squared_prediction_error_m2_);
      typical_match_ += share * (match.matched - typical_match_);
      if (match.is_turn_measured) imu_trust_.compare(match.T_previous_predicted, match.T_previous_lidar);
    }
    if (gap_s > 0.0 && gap_s <= Matching::kLongestGap_s) {
      velocity_.advance(gap_s, match.T_previous_lidar, match.position_information);
      motion_ =
          match.is_tracked ? motion_found(match.T_previous_lidar, stamp_s) : twist_of(match.T_previous_lidar, gap_s);
      motion_->linear_mps = velocity_.velocity_mps();
    } else {
      motion_.reset();
      velocity_ = {};
    }
  }
  T_odom_lidar_ = match.T_odom_lidar;
  const Eigen::Vector3f here = T_odom_lidar_.translation().cast<float>();
  const bool forgets = (here - forgotten_from_).norm() > Matching::kForgetEvery_m;
  if (forgets) forgotten_from_ = here;
  wait();
  insertion_->run(
      [map = map_.get(), forgets, here,
       points = match.is_tracked ? in_map(scan.map_points, T_odom_lidar_) : std::vector<Eigen::Vector3f>()] {
        map->add(points);
        if (forgets) map->forget_far_from(here);
      });
  last_stamp_s_ = stamp_s;
  untracked_m_ = match.is_tracked ? 0.0 : untracked_m_ + match.measured_m.value_or(0.0);
  if (match.is_tracked) {
    tracked_stamp_s_ = stamp_s;
    last_sideways_ = match.matched_sideways;
    last_view_.set(scan.map_points, match.T_odom_lidar);
    T_odom_tracked_ = match.T_odom_lidar;
  }
  start_was_untracked_ = start_was_untracked_ || (scans_ < Matching::kFirstScans && !match.is_tracked);
  ++scans_;
}

// Where track is found again, the poses in between were predicted, and the step from the last one makes up for them.
Twist ScanMatcher::motion_found(const Pose& T_previous_lidar, double stamp_s) const {
  const double since_tracked_s = stamp_s - tracked_stamp_s_;
  if (since_tracked_s > Matching::kLongestGap_s) return twist_of(T_previous_lidar, stamp_s - last_stamp_s_);
  return twist_of(normalised(T_odom_tracked_.inverse() * T_odom_lidar_ * T_previous_lidar), since_tracked_s);
}

void ScanMatcher::restart() {
  wait();
  map_.reset();
  motion_.reset();
  velocity_ = {};
  squared_prediction_error_m2_ = typical_match_ = last_sideways_ = 0.0;
  scans_ = 0;
  start_was_untracked_ = false;
}

}  // namespace revisit
