// SPDX-License-Identifier: Apache-2.0
#include "inbox.hpp"

#include <algorithm>
#include <utility>

namespace revisit::node {
namespace {

using namespace std::chrono_literals;

struct Keeping {
  static constexpr std::chrono::milliseconds kForCloud = 1s, kForOthers = 100ms;
  static constexpr std::int64_t kStillComing_ns = 1'000'000'000;  ///< what came so long ago goes on coming
  static constexpr std::int64_t kKept_ns = 5'000'000'000;
  static constexpr std::int64_t kNear_ns = 200'000'000;  ///< an odometry that counts for a scan
  static constexpr std::size_t kMostFixes = 100;
};

template <typename Kind>
bool is_before(const Kind& message, std::int64_t stamp_ns) {
  return message.stamp_ns < stamp_ns;
}

}  // namespace

void Inbox::add(Cloud cloud) {
  const std::lock_guard lock(mutex_);
  if (is_closed_) return;
  clouds_.push_back(std::move(cloud));
  while (clouds_.size() > longest_queue_) {
    clouds_.pop_front();
    ++dropped_;
  }
  news_.notify_one();
}

void Inbox::add(const GpsFix& fix) {
  const std::lock_guard lock(mutex_);
  if (fixes_.size() < Keeping::kMostFixes) fixes_.push_back(fix);
}

void Inbox::add(const InitialPose& pose) {
  const std::lock_guard lock(mutex_);
  initial_pose_ = pose;
}

void Inbox::close() {
  const std::lock_guard lock(mutex_);
  is_closed_ = true;
  news_.notify_one();
}

template <typename Kind>
void Inbox::keep(std::deque<Kind>& kept, const Kind& message) {
  const std::lock_guard lock(mutex_);
  if (!kept.empty() && message.stamp_ns < kept.back().stamp_ns - Keeping::kKept_ns)
    kept.clear();  // the clock was set back: another bag
  const auto after = std::lower_bound(kept.begin(), kept.end(), message.stamp_ns, is_before<Kind>);
  if (after != kept.end() && after->stamp_ns == message.stamp_ns) return;
  kept.insert(after, message);
  while (kept.front().stamp_ns < kept.back().stamp_ns - Keeping::kKept_ns) kept.pop_front();
  news_.notify_one();
}
template void Inbox::keep(std::deque<Imu>&, const Imu&);
template void Inbox::keep(std::deque<Odometry>&, const Odometry&);

std::optional<Cloud> Inbox::next() {
  std::unique_lock lock(mutex_);
  news_.wait_for(lock, Keeping::kForCloud, [&] { return is_closed_ || !clouds_.empty(); });
  if (clouds_.empty()) return std::nullopt;
  Cloud cloud = std::move(clouds_.front());
  clouds_.pop_front();
  return cloud;
}

bool Inbox::is_done() const {
  const std::lock_guard lock(mutex_);
  return is_closed_ && clouds_.empty();
}

std::vector<GpsFix> Inbox::take_fixes() {
  const std::lock_guard lock(mutex_);
  return std::exchange(fixes_, {});
}

std::optional<InitialPose> Inbox::take_initial_pose() {
  const std::lock_guard lock(mutex_);
  return std::exchange(initial_pose_, std::nullopt);
}

void Inbox::wait_for_others(std::int64_t imu_ns, std::int64_t odometry_ns, bool is_first) {
  std::unique_lock lock(mutex_);
  // Whether messages of one kind have come up to that time, or come no more.
  const auto is_up_to = [&](const auto& kept, std::int64_t until_ns) {
    if (kept.empty()) return !is_first;
    return kept.back().stamp_ns >= until_ns || kept.back().stamp_ns < until_ns - Keeping::kStillComing_ns;
  };
  news_.wait_for(lock, Keeping::kForOthers,
                 [&] { return is_closed_ || (is_up_to(imu_, imu_ns) && is_up_to(odometry_, odometry_ns)); });
}

std::vector<Imu> Inbox::imu_between(std::int64_t from_ns, std::int64_t to_ns) const {
  const std::lock_guard lock(mutex_);
  std::vector<Imu> between;
  for (const Imu& each : imu_)
    if (each.stamp_ns >= from_ns && each.stamp_ns <= to_ns) between.push_back(each);
  return between;
}

std::optional<Odometry> Inbox::odometry_at(std::int64_t stamp_ns) const {
  const std::lock_guard lock(mutex_);
  if (odometry_.empty()) return std::nullopt;
  const auto after = std::lower_bound(odometry_.begin(), odometry_.end(), stamp_ns, is_before<Odometry>);
  if (after == odometry_.begin() || after == odometry_.end()) {
    const Odometry& nearest = after == odometry_.end() ? odometry_.back() : *after;
    const bool is_near = std::abs(nearest.stamp_ns - stamp_ns) < Keeping::kNear_ns;
    return is_near ? std::optional(nearest) : std::nullopt;
  }
  const Odometry &a = *(after - 1), &b = *after;
  if (b.stamp_ns - a.stamp_ns > Keeping::kStillComing_ns) return std::nullopt;
  const double share = static_cast<double>(stamp_ns - a.stamp_ns) / static_cast<double>(b.stamp_ns - a.stamp_ns);
  Odometry between = b;
  between.stamp_ns = stamp_ns;
  const Transform3 &T_a = a.T_odom_child, &T_b = b.T_odom_child;
  between.T_odom_child.translation() = (1.0 - share) * T_a.translation() + share * T_b.translation();
  between.T_odom_child.linear() =
      Eigen::Quaterniond(T_a.linear()).slerp(share, Eigen::Quaterniond(T_b.linear())).toRotationMatrix();
  return between;
}

bool Inbox::has_odometry() const {
  const std::lock_guard lock(mutex_);
  return !odometry_.empty();
}

std::size_t Inbox::waiting() const {
  const std::lock_guard lock(mutex_);
  return clouds_.size();
}

std::size_t Inbox::dropped() const {
  const std::lock_guard lock(mutex_);
  return dropped_;
}

}  // namespace revisit::node
