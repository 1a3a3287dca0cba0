// SPDX-License-Identifier: Apache-2.0
#include <revisit/preprocess/imu_track.hpp>

#include <algorithm>
#include <cmath>

namespace revisit {
namespace {

struct Tracking {
  static constexpr double kLongestGap_s = 0.05;  ///< between readings: IMUs give 100 a second and more
  static constexpr double kKept_s = 2.0;
  /// How fast accelerations pull: a vehicle brakes for a few seconds, gyros drift by some 0.01 rad in them.
  static constexpr double kPull_s = 5.0;
  static constexpr double kFirstPull_s = 0.2;  ///< at the beginning, where nothing else is known
  static constexpr double kSteady = 0.1;       ///< accelerations farther from gravity's length than this say less
};

Eigen::Matrix3d rotation(const Eigen::Vector3d& turn) {
  const double angle = turn.norm();
  if (angle < 1e-12) return Eigen::Matrix3d::Identity();
  return Eigen::AngleAxisd(angle, turn / angle).toRotationMatrix();
}

}  // namespace

void ImuTrack::add(const Scan& scan) {
  for (const ImuSample& sample : scan.imu) {
    const Reading reading{scan.stamp_s + sample.time_s, sample.angular_radps.cast<double>(),
                          sample.acceleration_mps2.cast<double>()};
    if (!recent_.empty() && reading.stamp_s <= recent_.back().stamp_s + 1e-6) continue;
    if (!reading.angular_radps.allFinite() || !reading.acceleration.allFinite()) continue;
    follow(reading);
  }
  while (!recent_.empty() && recent_.front().stamp_s < scan.stamp_s - Tracking::kKept_s) recent_.pop_front();

  const auto [first, last] = std::minmax_element(scan.times_s.begin(), scan.times_s.end());
  const double from_s = scan.stamp_s + (scan.times_s.empty() ? 0.0 : static_cast<double>(*first)),
               to_s = scan.stamp_s + (scan.times_s.empty() ? 0.0 : static_cast<double>(*last));
  rate_in_sweep_.reset();
  turn_since_last_.reset();
  up_.reset();
  if (covers(from_s, to_s)) rate_in_sweep_ = mean_rate(from_s, to_s);
  if (last_scan_s_ && *last_scan_s_ < scan.stamp_s && covers(*last_scan_s_, scan.stamp_s))
    turn_since_last_ = turn(*last_scan_s_, scan.stamp_s);
  if (covers(scan.stamp_s, scan.stamp_s) && up_now_.norm() > 0.5)  // back from the last reading to the stamp
    up_ = (turn(scan.stamp_s, recent_.back().stamp_s) * up_now_).cast<float>().normalized();
  last_scan_s_ = scan.stamp_s;
}

void ImuTrack::follow(const Reading& reading) {
  const double length = reading.acceleration.norm();
  const double gap_s = recent_.empty() ? 1e9 : reading.stamp_s - recent_.back().stamp_s;
  if (gap_s > Tracking::kLongestGap_s) {
    recent_.clear();
    up_now_.setZero();
    followed_s_ = 0.0;
  }
  recent_.push_back(reading);
  if (!(length > 0.0)) return;
  const Eigen::Vector3d felt = reading.acceleration / length;
  if (up_now_.norm() < 0.5) {
    up_now_ = felt;
    usual_acceleration_ = length;
    return;
  }
  followed_s_ += gap_s;
  up_now_ = rotation(-reading.angular_radps * gap_s) * up_now_;
  const double off = std::abs(length / usual_acceleration_ - 1.0) / Tracking::kSteady;
  const double pull_s = std::clamp(followed_s_, Tracking::kFirstPull_s, Tracking::kPull_s);
  const double weight = std::min(1.0, gap_s / pull_s) / (1.0 + off * off);
  up_now_ = ((1.0 - weight) * up_now_ + weight * felt).normalized();
  usual_acceleration_ += std::min(1.0, gap_s / Tracking::kPull_s) * (length - usual_acceleration_);
}

bool ImuTrack::covers(double from_s, double to_s) const {
  return !recent_.empty() && recent_.front().stamp_s <= from_s + Tracking::kLongestGap_s &&
         recent_.back().stamp_s >= to_s - Tracking::kLongestGap_s;
}

Eigen::Vector3d ImuTrack::mean_rate(double from_s, double to_s) const {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero(), nearest = recent_.back().angular_radps;
  int count = 0;
  for (const Reading& reading : recent_) {
    if (reading.stamp_s <= to_s) nearest = reading.angular_radps;
    if (reading.stamp_s < from_s || reading.stamp_s > to_s) continue;
    sum += reading.angular_radps;
    ++count;
  }
  return count > 0 ? Eigen::Vector3d(sum / count) : nearest;
}

// Each reading holds since the one before.
Eigen::Matrix3d ImuTrack::turn(double from_s, double to_s) const {
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  double at_s = from_s;
  for (const Reading& reading : recent_) {
    if (reading.stamp_s <= from_s) continue;
    const double until_s = std::min(reading.stamp_s, to_s);
    R = R * rotation(reading.angular_radps * (until_s - at_s));
    at_s = until_s;
    if (reading.stamp_s >= to_s) break;
  }
  if (at_s < to_s) R = R * rotation(recent_.back().angular_radps * (to_s - at_s));
  return R;
}

}  // namespace revisit
