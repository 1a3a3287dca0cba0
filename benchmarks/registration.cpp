// SPDX-License-Identifier: Apache-2.0
// Registration of two HDL-64E scans of a simulated town, 2 to 4 m apart, from the identity or a yaw guess: preparing a
// scan, aligning a pair (argument: threads), and PCL's point-to-plane ICP on the same clouds as a reference.
#include <benchmark/benchmark.h>

#include <stdexcept>
#include <vector>

#include <oneapi/tbb/global_control.h>

#include <revisit/registration/icp.hpp>
#include <revisit/registration/surface_cloud.hpp>
#include <revisit/simulation/simulated_recording.hpp>

#include "oracles/pcl_icp.hpp"

namespace {

using namespace revisit;

struct Pair {
  Scan target_scan;
  SurfaceCloud target, source;
  Pose T_target_source;
};

// Scans 3 apart: 2.4 to 4 m.
const std::vector<Pair>& pairs() {
  static const std::vector<Pair> all = [] {
    SimulationOptions options;
    options.seed = 301;
    options.motion_distortion = false;
    const auto drive = simulate(options);
    if (!drive) throw std::runtime_error(drive.error().message);
    const Trajectory& poses = (*drive)->trajectory();
    std::vector<Pair> result;
    for (std::size_t i = 100; i < 900; i += 100) {
      const Scan a = *(*drive)->read(i), b = *(*drive)->read(i + 3);
      const Pose T = poses.at((*drive)->frame(i))->inverse() * *poses.at((*drive)->frame(i + 3));
      result.push_back({a, SurfaceCloud(thin(a.points, {}, 1.0)), SurfaceCloud(thin(b.points, {}, 1.0)), T});
    }
    return result;
  }();
  return all;
}

void thin_scan(benchmark::State& state) {
  const auto& all = pairs();
  std::size_t next = 0, points = 0;
  for (auto _ : state) {
    const Scan& scan = all[next++ % all.size()].target_scan;
    benchmark::DoNotOptimize(thin(scan.points, {}, 1.0).points.data());
    points += scan.points.size();
  }
  state.counters["points"] = static_cast<double>(points) / static_cast<double>(state.iterations());
}

void prepare_surface(benchmark::State& state) {
  std::vector<ThinCloud> clouds;
  for (const Pair& pair : pairs()) clouds.push_back(thin(pair.target_scan.points, {}, 1.0));
  std::size_t next = 0;
  for (auto _ : state) benchmark::DoNotOptimize(SurfaceCloud(clouds[next++ % clouds.size()]).size());
  state.counters["points"] = static_cast<double>(clouds[0].points.size());
}

void align(benchmark::State& state) {
  const oneapi::tbb::global_control threads(oneapi::tbb::global_control::max_allowed_parallelism,
                                            static_cast<std::size_t>(state.range(0)));
  std::size_t next = 0;
  double worst_m = 0.0, iterations = 0.0;
  for (auto _ : state) {
    const Pair& pair = pairs()[next++ % pairs().size()];
    Pose T_guess = Pose::Identity();
    T_guess.linear() = pair.T_target_source.linear();
    const IcpResult result = align_icp(pair.target, pair.source.points(), T_guess);
    worst_m = std::max(worst_m, (result.T_target_source.inverse() * pair.T_target_source).translation().norm());
    iterations += result.iterations;
  }
  state.counters["worst_m"] = worst_m;
  state.counters["icp_steps"] = iterations / static_cast<double>(state.iterations());
}

void pcl_align(benchmark::State& state) {
  std::size_t next = 0;
  double worst_m = 0.0;
  for (auto _ : state) {
    const Pair& pair = pairs()[next++ % pairs().size()];
    Pose T_guess = Pose::Identity();
    T_guess.linear() = pair.T_target_source.linear();
    const Pose T = oracles::pcl_point_to_plane(pair.target, pair.source, T_guess, 2.0, 60);
    worst_m = std::max(worst_m, (T.inverse() * pair.T_target_source).translation().norm());
  }
  state.counters["worst_m"] = worst_m;
}

}  // namespace

BENCHMARK(thin_scan)->Unit(benchmark::kMillisecond);
BENCHMARK(prepare_surface)->Unit(benchmark::kMillisecond);
BENCHMARK(align)->Arg(1)->Arg(2)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK(pcl_align)->Unit(benchmark::kMillisecond)->UseRealTime();

BENCHMARK_MAIN();
