// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <mutex>
#include <optional>
#include <vector>

#include "messages.hpp"

namespace revisit::node {

/// Where messages wait for the node's thread. Clouds wait in a queue that drops its oldest; of IMU and odometry the
/// last seconds are kept. All functions may be called from any thread; those that put something in return at once.
class Inbox {
 public:
  explicit Inbox(std::size_t longest_queue) : longest_queue_(longest_queue) {}

  void add(Cloud cloud);
  void add(const Imu& imu) { keep(imu_, imu); }
  void add(const Odometry& odometry) { keep(odometry_, odometry); }
  void add(const GpsFix& fix);
  void add(const InitialPose& pose);
  /// Later messages are left out; waiting ends.
  void close();

  /// The cloud that has waited longest. Nothing where none comes in a second, or all are done and the inbox is closed.
  std::optional<Cloud> next();
  bool is_done() const;
  std::vector<GpsFix> take_fixes();
  std::optional<InitialPose> take_initial_pose();

  /// Until IMU readings have come up to `imu_ns` and odometry up to `odometry_ns`, as far as they come at all; a tenth
  /// of a second at most. `is_first`: nobody knows yet what comes.
  void wait_for_others(std::int64_t imu_ns, std::int64_t odometry_ns, bool is_first);
  std::vector<Imu> imu_between(std::int64_t from_ns, std::int64_t to_ns) const;
  /// Between the messages before and after. Nothing where none is near.
  std::optional<Odometry> odometry_at(std::int64_t stamp_ns) const;
  bool has_odometry() const;

  std::size_t waiting() const;
  std::size_t dropped() const;

 private:
  template <typename Kind>
  void keep(std::deque<Kind>& kept, const Kind& message);

  const std::size_t longest_queue_;
  mutable std::mutex mutex_;
  std::condition_variable news_;
  std::deque<Cloud> clouds_;
  std::deque<Imu> imu_;
  std::deque<Odometry> odometry_;
  std::vector<GpsFix> fixes_;
  std::optional<InitialPose> initial_pose_;
  std::size_t dropped_ = 0;
  bool is_closed_ = false;
};

}  // namespace revisit::node
