// SPDX-License-Identifier: Apache-2.0
#include "node.hpp"

#include <algorithm>
#include <chrono>
#include <exception>
#include <mutex>
#include <thread>
#include <utility>

#include <revisit/core/stopwatch.hpp>

#include "inbox.hpp"
#include "mode.hpp"
#include "translate.hpp"

namespace revisit::node {
namespace {

class ThreadedNode final : public Node {
 public:
  ThreadedNode(const Settings& settings, Outlet& outlet, std::unique_ptr<Mode> mode)
      : map_frame_(settings.map_frame),
        outlet_(outlet),
        inbox_(settings.queue),
        moments_(settings, inbox_, outlet),
        mode_(std::move(mode)),
        worker_([this] { work(); }) {}
  ~ThreadedNode() override {
    std::string ignored;
    (void)finish(ignored);
  }

  void add(Cloud cloud) override { inbox_.add(std::move(cloud)); }
  void add(const Imu& imu) override { inbox_.add(imu); }
  void add(const Odometry& odometry) override {
    if (odometry.T_odom_child.matrix().allFinite()) inbox_.add(odometry);
  }
  void add(const GpsFix& fix) override { inbox_.add(fix); }
  void add(const InitialPose& pose) override { inbox_.add(pose); }

  bool save_map(const std::string& folder, std::string& message) override {
    return tell(message, [&] { return mode_->save(folder); });
  }
  bool load_map(const std::string& path, std::string& message) override {
    return tell(message, [&] { return mode_->load(path); });
  }
  bool publish_map(std::string& message) override {
    return tell(message, [&] { return mode_->publish(); });
  }
  bool finish(std::string& message) override {
    inbox_.close();
    const std::lock_guard one_at_a_time(finish_mutex_);
    if (!worker_.joinable()) return true;
    worker_.join();
    const bool is_finished = tell(message, [&]() -> Result<std::string> {
      if (const Status finished = mode_->finish(); !finished) return finished.error();
      return mode_->state();
    });
    send_health();
    return is_finished;
  }

 private:
  // No exception leaves the node: memory that is not there, misuse that no test has found. The store may then be in the
  // middle of something.
  template <typename Value, typename Ask>
  Result<Value> caught(Ask ask) {
    if (!broken_.empty()) return Error{broken_};
    try {
      return ask();
    } catch (const std::exception& e) {
      broken_ = std::string("the node works no more after an error; end it and start it with resume: ") + e.what();
      return Error{broken_};
    }
  }
  template <typename Ask>
  bool tell(std::string& message, Ask ask) {
    const std::lock_guard lock(mode_mutex_);
    const Result<std::string> answer = caught<std::string>(ask);
    message = answer ? *answer : answer.error().message;
    return static_cast<bool>(answer);
  }

  void work() {
    constexpr auto kHealthEvery = std::chrono::seconds(1);
    auto next_health = std::chrono::steady_clock::now();
    while (!inbox_.is_done()) {
      if (const auto cloud = inbox_.next()) {
        Stopwatch watch;
        Status status = ok();
        try {
          status = work_on(*cloud);
        } catch (const std::exception& e) {
          status = Error{std::string("scan left out: ") + e.what()};
        }
        if (!status) {
          ++skipped_;
          outlet_.log(true, status.error().message);
        }
        latest_ms_ = watch.lap_ms();
        slowest_ms_ = std::max(slowest_ms_, latest_ms_);
      }
      if (std::chrono::steady_clock::now() < next_health) continue;
      next_health = std::chrono::steady_clock::now() + kHealthEvery;
      send_health();
    }
  }

  Status work_on(const Cloud& cloud) {
    const std::int64_t number = scans_++;
    auto scan = to_scan(cloud, number, log_to(outlet_));
    if (!scan) return scan.error();
    const Moment moment = moments_.of(cloud, *scan);
    const std::lock_guard lock(mode_mutex_);
    const auto done = caught<bool>([&]() -> Result<bool> {
      for (const GpsFix& fix : inbox_.take_fixes())
        if (const Status added = mode_->add(to_gps_fix(fix)); !added) return added.error();
      if (const auto initial = inbox_.take_initial_pose())
        if (const Status taken = expect(*initial, moment); !taken) outlet_.log(true, taken.error().message);
      if (const Status processed = mode_->process(*std::move(scan), moment); !processed) return processed.error();
      return true;
    });
    return done ? ok() : Status(done.error());
  }

  Status expect(const InitialPose& initial, const Moment& moment) {
    if (!initial.frame_id.empty() && initial.frame_id != map_frame_)
      return Error{"initial pose in the frame " + initial.frame_id + "; it must be in " + map_frame_};
    if (!initial.T_map_base.matrix().allFinite()) return Error{"initial pose: not a pose"};
    return mode_->expect(normalised(initial.T_map_base * moment.T_base_lidar.value_or(Pose::Identity())));
  }

  void send_health() {
    Health health;
    {
      const std::lock_guard lock(mode_mutex_);
      health.message = mode_->state();
    }
    const std::size_t dropped = inbox_.dropped();
    if (dropped > reported_dropped_ || skipped_ > reported_skipped_) health.level = Health::kWarning;
    if (dropped > reported_dropped_)
      outlet_.log(true, std::to_string(dropped - reported_dropped_) + " scans were left out: they come faster than " +
                            "they are worked on");
    reported_dropped_ = dropped, reported_skipped_ = skipped_;
    health.values = {{"scans", std::to_string(scans_)},
                     {"scans left out, since too many waited", std::to_string(dropped)},
                     {"scans that could not be used", std::to_string(skipped_)},
                     {"scans waiting", std::to_string(inbox_.waiting())},
                     {"last scan took, ms", std::to_string(latest_ms_)},
                     {"slowest scan took, ms", std::to_string(slowest_ms_)}};
    outlet_.send(health);
  }

  const std::string map_frame_;
  Outlet& outlet_;
  Inbox inbox_;
  Moments moments_;
  std::mutex mode_mutex_, finish_mutex_;
  std::unique_ptr<Mode> mode_;
  std::string broken_;  ///< why, once it is
  // Of the worker, and of finish() once it has ended.
  std::int64_t scans_ = 0;
  std::size_t skipped_ = 0, reported_dropped_ = 0, reported_skipped_ = 0;
  double latest_ms_ = 0.0, slowest_ms_ = 0.0;
  std::thread worker_;
};

Result<std::unique_ptr<Mode>> make_mode(const Settings& settings, const Parameters& parameters, Outlet& outlet) {
  const LogSink log = log_to(outlet);
  if (settings.mode == "detect") return make_detect_mode(parameters, outlet, log);
  if (settings.mode == "slam") return make_slam_mode(settings, parameters, outlet, log);
  if (settings.mode == "localise") return make_localise_mode(settings, parameters, outlet, log);
  return Error{"mode is '" + settings.mode + "'; allowed: detect, slam, localise"};
}

}  // namespace

std::unique_ptr<Node> Node::make(const Settings& settings, Outlet& outlet, std::string& error) {
  Parameters values;
  Status status = ok();
  for (const auto& [name, value] : settings.parameters)
    if (status) status = set_parameter(values, name, value);
  if (status) status = validate(values);
  if (status) {
    auto mode = make_mode(settings, values, outlet);
    if (mode) return std::make_unique<ThreadedNode>(settings, outlet, *std::move(mode));
    status = mode.error();
  }
  error = status.error().message;
  return nullptr;
}

}  // namespace revisit::node
