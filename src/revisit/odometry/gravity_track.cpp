// SPDX-License-Identifier: Apache-2.0
#include <revisit/odometry/gravity_track.hpp>

#include <algorithm>
#include <cmath>

#include <revisit/core/twist.hpp>

namespace revisit {
namespace {

struct Gravity {
  static constexpr double kWindow_s = 4.0;
  static constexpr double kLongestInterval_s = 0.5;  ///< between two scans
  static constexpr int kFewestReadings = 3;          ///< of an interval
  static constexpr double kMargin = 0.2;             ///< of an interval, at either end, that may be without
  static constexpr double kFarthest_s = 1.0;         ///< readings from the scan that they come with
  static constexpr double k_mps2 = 9.81;
  static constexpr double kUnit_mps2 = 3.0;  ///< what is smaller than this was given in units of gravity
  static constexpr double kMostOff = 0.05;   ///< of its length: what is farther off was no gravity
};

}  // namespace

void GravityTrack::restart() {
  felt_.clear();
  intervals_.clear();
  last_stamp_s_.reset();
}

void GravityTrack::add(const Scan& scan, double stamp_s, const Pose& T_odom_lidar) {
  for (const ImuSample& sample : scan.imu) {
    const Felt felt{stamp_s + sample.time_s, sample.acceleration_mps2.cast<double>()};
    const bool is_near = std::abs(sample.time_s) < Gravity::kFarthest_s;  // not so where it is not finite
    if (is_near && felt.acceleration.allFinite() && (felt_.empty() || felt.stamp_s > felt_.back().stamp_s))
      felt_.push_back(felt);
  }
  if (last_stamp_s_) {
    const double length_s = stamp_s - *last_stamp_s_;
    const auto felt = length_s < Gravity::kLongestInterval_s ? mean_felt(stamp_s, T_odom_lidar) : std::nullopt;
    if (felt)
      intervals_.push_back({0.5 * (*last_stamp_s_ + stamp_s), length_s, *felt,
                            (T_odom_lidar.translation() - T_odom_last_.translation()) / length_s});
    else
      intervals_.clear();
  }
  while (!felt_.empty() && felt_.front().stamp_s <= stamp_s) felt_.pop_front();
  while (!intervals_.empty() && intervals_.front().middle_s < stamp_s - Gravity::kWindow_s) intervals_.pop_front();
  last_stamp_s_ = stamp_s;
  T_odom_last_ = T_odom_lidar;
}

// Since the last scan, turned into odometry's frame by where the sensor was at each reading.
std::optional<Eigen::Vector3d> GravityTrack::mean_felt(double stamp_s, const Pose& T_odom_lidar) const {
  const Eigen::Quaterniond from(T_odom_last_.linear()), to(T_odom_lidar.linear());
  const double length_s = stamp_s - *last_stamp_s_;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  int count = 0;
  double first = 1.0, last = 0.0;
  for (const Felt& each : felt_) {
    const double share = (each.stamp_s - *last_stamp_s_) / length_s;
    if (share <= 0.0 || share > 1.0) continue;
    sum += from.slerp(share, to) * each.acceleration;
    first = std::min(first, share);
    last = std::max(last, share);
    ++count;
  }
  const bool covers = first < Gravity::kMargin && last > 1.0 - Gravity::kMargin;
  if (count < Gravity::kFewestReadings || !covers) return std::nullopt;
  return sum / count;
}

// The change of velocity from the middle of one interval to that of the next is what was felt meanwhile, less gravity.
// Weighed by a Hann window, inner velocities fall out but for the change of the weights: their errors hardly count.
std::optional<Eigen::Vector3f> GravityTrack::up() const {
  constexpr double kLeast_s = 0.9 * Gravity::kWindow_s;
  if (intervals_.size() < 3) return std::nullopt;
  const double first_s = intervals_.front().middle_s, length_s = intervals_.back().middle_s - first_s;
  if (length_s < kLeast_s) return std::nullopt;
  const double unit = intervals_.front().felt.norm() < Gravity::kUnit_mps2 ? Gravity::k_mps2 : 1.0;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double weights_s = 0.0;
  for (auto b = intervals_.begin() + 1; b != intervals_.end(); ++b) {
    const auto a = b - 1;
    const double at = (0.5 * (a->middle_s + b->middle_s) - first_s) / length_s;
    const double weight = 0.5 - 0.5 * std::cos(2.0 * kPi * at);
    sum +=
        weight * (0.5 * unit * (a->length_s * a->felt + b->length_s * b->felt) - (b->velocity_mps - a->velocity_mps));
    weights_s += weight * 0.5 * (a->length_s + b->length_s);
  }
  const Eigen::Vector3d gravity_mps2 = sum / weights_s;
  if (std::abs(gravity_mps2.norm() / Gravity::k_mps2 - 1.0) > Gravity::kMostOff) return std::nullopt;
  return (T_odom_last_.linear().transpose() * gravity_mps2.normalized()).cast<float>();
}

}  // namespace revisit
