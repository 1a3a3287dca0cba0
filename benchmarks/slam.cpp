// SPDX-License-Identifier: Apache-2.0
// Trajectory and map from HDL-64E scans with motion distortion: odometry alone, and everything together. The counter
// scans_a_second is what matters; 10 is what the sensor gives.
#include <benchmark/benchmark.h>

#include <filesystem>

#include <revisit/pipeline/loop_detector.hpp>
#include <revisit/pipeline/slam.hpp>
#include <revisit/preprocess/range_filter.hpp>
#include <revisit/simulation/simulated_recording.hpp>

namespace {

using namespace revisit;

const std::vector<Scan>& scans() {
  static const std::vector<Scan> all = [] {
    SimulationOptions options;
    options.seed = 7;
    options.length_m = 300.0;
    options.frames = 150;
    const auto recording = *simulate(options);
    std::vector<Scan> read;
    for (std::size_t i = 0; i < recording->size(); ++i) read.push_back(*recording->read(i));
    return read;
  }();
  return all;
}

void count(benchmark::State& state, std::size_t done) {
  state.counters["scans_a_second"] = benchmark::Counter(static_cast<double>(done), benchmark::Counter::kIsRate);
}

void odometry_alone(benchmark::State& state) {
  const std::vector<Scan>& all = scans();
  std::size_t done = 0;
  for (auto _ : state) {
    Odometry odometry;
    for (Scan scan : all) {
      filter_range(scan, {});
      benchmark::DoNotOptimize(odometry.follow(scan));
      ++done;
    }
  }
  count(state, done);
}

// Detection with every scan: odometry, description, search, verification.
void detection(benchmark::State& state) {
  const std::vector<Scan>& all = scans();
  std::size_t done = 0;
  for (auto _ : state) {
    LoopDetector detector;
    for (const Scan& scan : all) {
      if (!detector.process(scan)) return state.SkipWithError("a scan was refused");
      ++done;
    }
  }
  count(state, done);
}

// With key frames, loop search, graph and store.
void everything(benchmark::State& state) {
  const auto file = std::filesystem::temp_directory_path() / "revisit_bench_slam.sqlite";
  SlamSetup setup;
  setup.scale.emplace().full_scale = 0.5;
  const std::vector<Scan>& all = scans();
  std::size_t done = 0;
  for (auto _ : state) {
    for (const char* ending : {"", "-wal", "-shm"}) std::filesystem::remove(file.string() + ending);
    auto store = MapStore::create(file);
    auto slam = Slam::open(std::make_shared<MapStore>(*std::move(store)), {}, setup);
    for (const Scan& scan : all) {
      if (!slam->process(scan)) return state.SkipWithError("a scan was refused");
      ++done;
    }
  }
  count(state, done);
}

}  // namespace

BENCHMARK(odometry_alone)->Unit(benchmark::kMillisecond)->UseRealTime()->MeasureProcessCPUTime();
BENCHMARK(detection)->Unit(benchmark::kMillisecond)->UseRealTime()->MeasureProcessCPUTime();
BENCHMARK(everything)->Unit(benchmark::kMillisecond)->UseRealTime()->MeasureProcessCPUTime();

BENCHMARK_MAIN();
