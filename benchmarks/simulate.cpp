// SPDX-License-Identifier: Apache-2.0
// Simulated scans a second, noise and intensity included. The argument is the number of threads that work on a scan;
// the counter `scans/s` counts wall-clock time.
#include <benchmark/benchmark.h>

#include <map>
#include <stdexcept>

#include <revisit/simulation/simulated_recording.hpp>

namespace {

using namespace revisit;

// Scans spread over the whole drive, so that no stretch of it decides.
void scans(benchmark::State& state, const char* world, const char* sensor) {
  SimulationOptions options;
  options.world = world;
  options.sensor = sensor;
  const auto recording = simulate(options, {}, static_cast<int>(state.range(0)));
  if (!recording) throw std::runtime_error(recording.error().message);
  std::size_t index = 0, points = 0;
  for (auto _ : state) {
    const auto scan = (*recording)->read(index);
    points += scan->points.size();
    index = (index + 97) % (*recording)->size();
  }
  const auto n = static_cast<double>(state.iterations());
  state.counters["beams"] = static_cast<double>((*recording)->sensor().beams());
  state.counters["points"] = static_cast<double>(points) / n;
  state.counters["scans/s"] = benchmark::Counter(n, benchmark::Counter::kIsRate);
}

}  // namespace

BENCHMARK_CAPTURE(scans, town_hdl64e, "town", "hdl64e")->Arg(1)->Arg(2)->UseRealTime()->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(scans, town_vlp16, "town", "vlp16")->Arg(2)->UseRealTime()->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(scans, town_os0_128, "town", "os0-128")->Arg(2)->UseRealTime()->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(scans, town_rosette, "town", "rosette")->Arg(2)->UseRealTime()->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(scans, warehouse_vlp16, "warehouse", "vlp16")->Arg(2)->UseRealTime()->Unit(benchmark::kMillisecond);

BENCHMARK_MAIN();
