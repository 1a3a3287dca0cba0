// SPDX-License-Identifier: Apache-2.0
#include <revisit/odometry/odometry.hpp>

#include <utility>

#include <revisit/preprocess/rings.hpp>
#include <revisit/preprocess/undistort.hpp>

namespace revisit {
namespace {

struct Following {
  static constexpr int kLostAfter_scans = 5;       ///< without track: what is predicted on is worth nothing any more
  static constexpr double kLostAfter_s = 5.0;      ///< between two scans, of which the second is not tracked
  static constexpr double kLongestGap_s = 2.0;     ///< between two scans; beyond, their motion says nothing of a sweep
  static constexpr double kTypicalPeriod_s = 0.1;  ///< where stamps do not increase
  /// Prediction error beyond which a sweep was compensated wrongly, and is once more with the motion that was found.
  static constexpr double kWrong_m = 0.1;
  static constexpr double kFastest_mps = 50.0;  ///< that a sensor moves while nobody listens
};

}  // namespace

OdometryStep Odometry::follow(const Scan& scan, const std::optional<Pose>& T_external_lidar) {
  const bool is_late = !has_last_ || scan.stamp_s > last_stamp_s_;
  const double stamp_s = is_late ? scan.stamp_s : last_stamp_s_ + Following::kTypicalPeriod_s;
  auto T_previous_lidar = motion_by_external(T_external_lidar);
  const bool was_restored = std::exchange(is_external_restored_, is_external_restored_ && !T_external_lidar);
  const bool is_guess = was_restored && !follows(stamp_s);
  if (is_guess && T_previous_lidar &&
      T_previous_lidar->translation().norm() > Following::kFastest_mps * (stamp_s - last_stamp_s_))
    T_previous_lidar.reset();
  const bool follows_closely = follows(stamp_s);
  imu_.add(scan);
  OdometryStep step = source_ == Source::kExternal ? take(scan, stamp_s, T_previous_lidar)
                                                   : match(scan, stamp_s, T_previous_lidar, is_guess);
  step.stamp_s = stamp_s;
  step.up = imu_.up();
  step.stamp_was_replaced = !is_late;
  step.is_connected = step.is_tracked && follows_closely && untracked_ == 0;
  step.segment = segment_;
  untracked_ = step.is_tracked ? 0 : untracked_ + 1;
  const bool was_carried = untracked_ > 0 && has_last_ && stamp_s > last_stamp_s_ + Following::kLostAfter_s;
  if (source_ == Source::kLidar && (was_carried || untracked_ >= Following::kLostAfter_scans)) {
    step.lost = true;
    ++segment_;
    matcher_.restart();
    untracked_ = 0;
  }
  if (step.is_tracked && is_late && !scan.imu.empty()) {
    gravity_.add(scan, stamp_s, step.T_odom_lidar);
    step.up_by_gravity = gravity_.up();
  } else {
    gravity_.restart();
  }
  has_last_ = true;
  last_stamp_s_ = stamp_s;
  T_odom_last_ = step.T_odom_lidar;
  if (T_external_lidar) set_external(*T_external_lidar);
  return step;
}

bool Odometry::follows(double stamp_s) const {
  return has_last_ && stamp_s - last_stamp_s_ <= Following::kLongestGap_s;
}

std::optional<Pose> Odometry::motion_by_external(const std::optional<Pose>& T_external_lidar) const {
  if (!T_external_lidar || !T_external_last_) return std::nullopt;
  // Since the scan before, which may have come without: from the last one that came with it.
  return normalised(T_odom_last_.inverse() * T_odom_at_external_ * (T_external_last_->inverse() * *T_external_lidar));
}

OdometryStep Odometry::take(const Scan& scan, double stamp_s, const std::optional<Pose>& T_previous_lidar) const {
  OdometryStep step;
  step.is_tracked = T_previous_lidar.has_value() || !has_last_;
  step.T_previous_lidar = T_previous_lidar.value_or(Pose::Identity());
  step.T_odom_lidar = normalised(T_odom_last_ * step.T_previous_lidar);
  if (T_previous_lidar && follows(stamp_s)) step.motion = twist_of(*T_previous_lidar, stamp_s - last_stamp_s_);
  if (step.motion && !scan.times_s.empty()) step.compensated = compensated(scan, *step.motion);
  return step;
}

OdometryStep Odometry::match(const Scan& scan, double stamp_s, const std::optional<Pose>& T_previous_lidar,
                             bool is_guess) {
  const bool is_swept = !scan.times_s.empty() && follows(stamp_s);
  if (!matcher_.has_map()) matcher_.set_rings(find_rings(scan).elevations_rad.size());
  OdometryStep step;
  step.motion = T_previous_lidar && follows(stamp_s) ? twist_of(*T_previous_lidar, stamp_s - last_stamp_s_)
                                                     : matcher_.predicted_motion(stamp_s);
  if (step.motion) step.motion = with_imu(*step.motion);
  if (step.motion && is_swept) {
    step.compensated = compensated(scan, *step.motion);
    if (first_scan_) begin_map_again(*step.motion);
  }
  using Measured = MotionGuess::Measured;
  std::optional<MotionGuess> guess;
  if (T_previous_lidar)
    guess = MotionGuess{*T_previous_lidar, is_guess ? Measured::kNothing : Measured::kAll};
  else if (const auto T_turned = motion_by_imu(stamp_s))
    guess = MotionGuess{*T_turned, Measured::kTurn};
  MatcherScan thinned = matcher_.thinned(step.compensated.empty() ? scan.points : step.compensated);
  thinned.is_stamp_assumed = scan.is_stamp_assumed || scan.stamp_s < stamp_s;
  // Before a scan is looked for elsewhere, its sweep is compensated again with the motion that was found, and matched
  // from there: that match measures how far it slides from where it was found first, not from the prediction.
  ScanMatch match = matcher_.match(stamp_s, thinned, guess);
  for (const bool is_around : {false, true}) {
    if (is_around) match = matcher_.look_around(stamp_s, thinned, match);
    if (is_swept && match.prediction_error_m > Following::kWrong_m) {
      const Twist found = with_imu(matcher_.motion_found(match.T_previous_found, stamp_s));
      std::vector<Point> again = compensated(scan, found);
      const bool has_new_map = first_scan_.has_value();
      if (has_new_map) begin_map_again(found);
      MatcherScan thinned_again = matcher_.thinned(again);
      thinned_again.is_stamp_assumed = thinned.is_stamp_assumed;
      ScanMatch matched_again = matcher_.match_again(stamp_s, thinned_again, match);
      if (is_around && !matched_again.is_tracked)
        matched_again = matcher_.look_around(stamp_s, thinned_again, matched_again);
      if (matched_again.is_tracked) {
        match = matched_again;
        step.motion = found;
        step.compensated = std::move(again);
        thinned = std::move(thinned_again);
      } else if (has_new_map) {
        match = matcher_.match(stamp_s, thinned, guess);
      }
    }
    if (match.is_tracked) break;
  }
  first_scan_.reset();
  if (!matcher_.has_map() && !step.motion && !scan.times_s.empty()) first_scan_ = scan;
  matcher_.accept(stamp_s, thinned, match);
  step.T_odom_lidar = match.T_odom_lidar;
  step.T_previous_lidar = match.T_previous_lidar;
  step.information = match.information;
  step.is_tracked = match.is_tracked;
  return step;
}

// The turn within the sweep as the IMU measured it.
Twist Odometry::with_imu(Twist predicted) const {
  if (imu_.rate_in_sweep_radps()) predicted.angular_radps = *imu_.rate_in_sweep_radps();
  return predicted;
}

// The predicted motion since the scan before, turned as the IMU measured it.
std::optional<Pose> Odometry::motion_by_imu(double stamp_s) const {
  if (!imu_.turn_since_last() || !follows(stamp_s)) return std::nullopt;
  Pose T = motion_after(matcher_.predicted_motion(stamp_s).value_or(Twist()), stamp_s - last_stamp_s_);
  T.linear() = *imu_.turn_since_last();
  return T;
}

// The first scan entered the map as it was swept: now that the motion is known, it enters it as it would have been seen
// at its stamp.
void Odometry::begin_map_again(const Twist& motion) {
  matcher_.restart();
  ScanMatch match;
  match.T_odom_lidar = T_odom_last_;
  match.is_tracked = true;
  matcher_.accept(last_stamp_s_, matcher_.thinned(compensated(*first_scan_, motion)), match);
  first_scan_.reset();
}

void Odometry::set_external(const Pose& T_external_lidar) {
  T_external_last_ = T_external_lidar;
  T_odom_at_external_ = T_odom_last_;
}

}  // namespace revisit
