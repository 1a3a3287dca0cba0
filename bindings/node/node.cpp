// SPDX-License-Identifier: Apache-2.0
#include "node.hpp"

#include <algorithm>
#include <chrono>
#include <exception>
#include <iterator>
#include <mutex>
#include <set>
#include <thread>
#include <tuple>
#include <utility>

#include <revisit/core/stopwatch.hpp>

#include "inbox.hpp"
#include "mode.hpp"
#include "translate.hpp"

namespace revisit::node {
namespace {

Result<Parameters> parameters_of(const Settings& settings) {
  Parameters values;
  for (const auto& [name, value] : settings.parameters)
    if (const Status set = set_parameter(values, name, value); !set) return set.error();
  if (const Status valid = validate(values); !valid) return valid.error();
  return values;
}

// The names of what differs. An error where something does that must stay while a node runs.
Result<std::string> changes_of(const Settings& before, const Settings& after) {
  const auto fixed = [](const Settings& of) {
    return std::tie(of.mode, of.resume, of.map_frame, of.odom_frame, of.base_frame, of.queue);
  };
  if (fixed(before) != fixed(after))
    return Error{
        "mode, resume, queue and the frames cannot change while the node runs; geometric.* and temporal.* can"};
  std::set<std::pair<std::string, std::string>> was(before.parameters.begin(), before.parameters.end()),
      is(after.parameters.begin(), after.parameters.end()), differs;
  std::set_symmetric_difference(was.begin(), was.end(), is.begin(), is.end(), std::inserter(differs, differs.end()));
  std::string changes;
  for (const auto& [name, value] : differs) {
    if (!name.starts_with("geometric.") && !name.starts_with("temporal."))
      return Error{name + ": cannot change while the node runs; geometric.* and temporal.* can"};
    if (!changes.ends_with(" " + name)) changes += " " + name;
  }
  return changes;
}

class ThreadedNode final : public Node {
 public:
  ThreadedNode(const Settings& settings, Outlet& outlet, std::unique_ptr<Mode> mode)
      : settings_(settings),
        outlet_(outlet),
        inbox_(settings.queue),
        clouds_(log_to(outlet)),
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
  bool change(const Settings& settings, std::string& message) override {
    return tell(message, [&]() -> Result<std::string> {
      const auto changes = changes_of(settings_, settings);
      if (!changes) return changes.error();
      const auto parameters = parameters_of(settings);
      if (!parameters) return parameters.error();
      mode_->set_verification(*parameters);
      settings_ = settings;
      return changes->empty() ? "nothing has changed" : "changed:" + *changes;
    });
  }
  bool get_map(MapGrid& grid, std::string& message) override {
    return tell(message, [&]() -> Result<std::string> {
      auto made = mode_->grid();
      if (!made) return made.error();
      grid = *std::move(made);
      return std::to_string(grid.width) + " x " + std::to_string(grid.height) + " cells";
    });
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
    auto message = clouds_.read(cloud, number);
    if (!message) return message.error();
    const Moment moment = moments_.of(*message);
    const std::lock_guard lock(mode_mutex_);
    const auto done = caught<bool>([&]() -> Result<bool> {
      for (const GpsFix& fix : inbox_.take_fixes())
        if (const Status added = mode_->add(to_gps_fix(fix)); !added) return added.error();
      if (const auto initial = inbox_.take_initial_pose())
        if (const Status taken = expect(*initial, moment); !taken) outlet_.log(true, taken.error().message);
      if (const Status processed = mode_->process(std::move(message->scan), moment); !processed)
        return processed.error();
      return true;
    });
    return done ? ok() : Status(done.error());
  }

  Status expect(const InitialPose& initial, const Moment& moment) {
    if (!initial.frame_id.empty() && initial.frame_id != settings_.map_frame)
      return Error{"initial pose in the frame " + initial.frame_id + "; it must be in " + settings_.map_frame};
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

  Settings settings_;
  Outlet& outlet_;
  Inbox inbox_;
  CloudReader clouds_;
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
  const auto values = parameters_of(settings);
  auto mode = values ? make_mode(settings, *values, outlet) : Result<std::unique_ptr<Mode>>(values.error());
  if (mode) return std::make_unique<ThreadedNode>(settings, outlet, *std::move(mode));
  error = mode.error().message;
  return nullptr;
}

}  // namespace revisit::node
