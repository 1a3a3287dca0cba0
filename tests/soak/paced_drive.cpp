// SPDX-License-Identifier: Apache-2.0
// Scans at the pace of a sensor, ten a second: paced_drive slam SENSOR MINUTES FOLDER maps a drive into FOLDER,
// paced_drive localise SENSOR MINUTES FOLDER SENSOR_OF_THE_MAP follows the drive of another day in that map. The scans
// wait in a queue, as in a driver's; one that finds it full is dropped. Each minute it says how long scans took from
// the end of their sweep to the answer, and how much memory there is. scripts/soak.sh runs both for an hour.
#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdio>
#include <cstdlib>
#include <deque>
#include <fstream>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include <unistd.h>

#include <revisit/pipeline/localiser.hpp>
#include <revisit/pipeline/slam.hpp>
#include <revisit/simulation/simulated_recording.hpp>

namespace {

using namespace revisit;
using Clock = std::chrono::steady_clock;

constexpr std::size_t kQueue = 10;  // scans: a second
constexpr auto kPeriod = std::chrono::milliseconds(100);
constexpr std::size_t kScansAMinute = 600;

struct Due {
  Scan scan;
  std::size_t index = 0;
  Clock::time_point at;
};

class Queue {
 public:
  bool push(Due due) {
    const std::lock_guard lock(mutex_);
    if (waiting_.size() == kQueue) return false;
    waiting_.push_back(std::move(due));
    changed_.notify_one();
    return true;
  }
  void close() {
    const std::lock_guard lock(mutex_);
    is_closed_ = true;
    changed_.notify_one();
  }
  std::optional<Due> pop() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return is_closed_ || !waiting_.empty(); });
    if (waiting_.empty()) return std::nullopt;
    Due due = std::move(waiting_.front());
    waiting_.pop_front();
    return due;
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Due> waiting_;
  bool is_closed_ = false;
};

double memory_mb() {
  std::ifstream statm("/proc/self/statm");
  double pages = 0.0, resident = 0.0;
  statm >> pages >> resident;
  return resident * static_cast<double>(sysconf(_SC_PAGESIZE)) / 1e6;
}

struct Load {
  std::vector<double> ms, memory_mb;  // of each scan; at the end of each minute
  std::size_t dropped = 0, late = 0;
};

double share(std::vector<double> values, double of) {
  if (values.empty()) return 0.0;
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(of * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

// `answer` says in a word how it stands.
Load drive(const SimulatedRecording& recording, std::size_t scans, const std::function<std::string(Due)>& answer) {
  Queue queue;
  Load load;
  std::atomic<std::size_t> dropped = 0, late = 0;
  std::thread driver([&] {
    Clock::time_point next = Clock::now() + kPeriod;
    for (std::size_t i = 0; i < scans; ++i, next += kPeriod) {
      auto scan = recording.read(i);
      if (!scan) continue;
      if (Clock::now() > next) {  // the simulator's own fault
        ++late;
        next = Clock::now();
      }
      std::this_thread::sleep_until(next);
      if (!queue.push({*std::move(scan), i, next})) ++dropped;
    }
    queue.close();
  });
  std::vector<double> minute;
  while (auto due = queue.pop()) {
    const Clock::time_point at = due->at;
    const std::size_t i = due->index;
    const std::string state = answer(*std::move(due));
    const double ms = std::chrono::duration<double, std::milli>(Clock::now() - at).count();
    load.ms.push_back(ms);
    minute.push_back(ms);
    if ((i + 1) % kScansAMinute != 0) continue;
    load.memory_mb.push_back(memory_mb());
    std::printf("%3zu min: median %.0f, 99 %% %.0f, most %.0f ms; %.0f MB; %zu dropped; %s\n", (i + 1) / kScansAMinute,
                share(minute, 0.5), share(minute, 0.99), share(minute, 1.0), load.memory_mb.back(), dropped.load(),
                state.c_str());
    std::fflush(stdout);
    minute.clear();
  }
  driver.join();
  load.dropped = dropped;
  load.late = late;
  std::printf("%zu scans: median %.0f, 99 %% %.0f, 99.9 %% %.0f, most %.0f ms; %zu dropped; %zu simulated too late\n",
              load.ms.size(), share(load.ms, 0.5), share(load.ms, 0.99), share(load.ms, 0.999), share(load.ms, 1.0),
              load.dropped, load.late);
  return load;
}

int fail(const std::string& message) {
  std::fprintf(stderr, "error: %s\n", message.c_str());
  return 1;
}

int run_slam(const SimulatedRecording& recording, std::size_t scans, const std::string& folder) {
  auto slam = Slam::open(folder);
  if (!slam) return fail(slam.error().message);
  std::size_t keyframes = 0, loops = 0, untracked = 0;
  std::vector<double> keyframes_by_minute;
  std::string failure;
  const Load load = drive(recording, scans, [&](Due due) {
    const std::size_t i = due.index;
    const auto step = slam->process(std::move(due.scan));
    if (!step) return failure = step.error().message;
    keyframes += step->is_keyframe;
    loops += step->loops_entered;
    untracked += !step->is_tracked;
    if ((i + 1) % kScansAMinute == 0) keyframes_by_minute.push_back(static_cast<double>(keyframes));
    return std::to_string(keyframes) + " key frames, " + std::to_string(loops) + " loops, " +
           std::to_string(untracked) + " scans not tracked";
  });
  if (!failure.empty()) return fail(failure);
  if (const Status done = slam->finish(); !done) return fail(done.error().message);
  const std::size_t minutes = load.memory_mb.size(), half = minutes / 2;
  if (minutes > half + 1 && minutes == keyframes_by_minute.size())
    std::printf("memory over the last half: %.1f kB a key frame\n",
                1e3 * (load.memory_mb.back() - load.memory_mb[half]) /
                    std::max(1.0, keyframes_by_minute.back() - keyframes_by_minute[half]));
  return load.dropped == 0 ? 0 : 1;
}

int run_localise(const SimulatedRecording& recording, const Pose& T_world_map, std::size_t scans,
                 const std::string& folder) {
  auto localiser = Localiser::open(folder);
  if (!localiser) return fail(localiser.error().message);
  std::size_t known = 0, lost = 0;
  std::vector<double> errors_m;
  std::string failure;
  const Load load = drive(recording, scans, [&](Due due) {
    const Pose T_truth =
        T_world_map.inverse() * recording.trajectory().entries.at(recording.frame(due.index)).T_world_lidar;
    const auto found = localiser->follow(std::move(due.scan));
    if (!found) return failure = found.error().message;
    ++(found->T_map_lidar ? known : lost);
    if (found->T_map_lidar) errors_m.push_back((found->T_map_lidar->translation() - T_truth.translation()).norm());
    return std::to_string(known) + " poses, " + std::to_string(lost) + " lost";
  });
  if (!failure.empty()) return fail(failure);
  // The map drifts a little; what is meant to be seen here are poses of another place.
  std::printf("from the truth: median %.2f m, 99 %% %.2f m, most %.2f m\n", share(errors_m, 0.5), share(errors_m, 0.99),
              share(errors_m, 1.0));
  const std::size_t half = load.memory_mb.size() / 2;
  if (load.memory_mb.size() > half + 1)
    std::printf("memory over the last half: %+.1f MB\n", load.memory_mb.back() - load.memory_mb[half]);
  return load.dropped == 0 ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  const bool maps = argc > 1 && std::string(argv[1]) == "slam";
  if (argc != (maps ? 5 : 6))
    return fail("usage: paced_drive slam SENSOR MINUTES FOLDER, or localise SENSOR MINUTES FOLDER SENSOR_OF_THE_MAP");
  const std::size_t scans = kScansAMinute * std::strtoull(argv[3], nullptr, 10);
  if (scans == 0) return fail(std::string("MINUTES is '") + argv[3] + "'; allowed: whole numbers from 1 on");
  SimulationOptions options;
  options.sensor = argv[2];
  options.seed = 24;
  options.difficulty = 1.0;
  options.length_m = 36000.0;
  options.day = maps ? 0 : 1;
  const auto recording = simulate(options);
  if (!recording) return fail(recording.error().message);
  const std::size_t there = std::min(scans, (*recording)->size());
  if (maps) return run_slam(**recording, there, argv[4]);
  options.day = 0;
  options.sensor = argv[5];
  const auto mapped = simulate(options);
  if (!mapped) return fail(mapped.error().message);
  return run_localise(**recording, (*mapped)->trajectory().entries.begin()->second.T_world_lidar, there, argv[4]);
}
