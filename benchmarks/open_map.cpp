// SPDX-License-Identifier: Apache-2.0
// From nothing to the first answer in a saved map of 50,000 key frames: finished, with its index in the file, and the
// same map as a run that was killed leaves it, whose key frames are read one by one.
#include <benchmark/benchmark.h>

#include <memory>

#include <revisit/core/stopwatch.hpp>
#include <revisit/pipeline/localiser.hpp>
#include <revisit/pipeline/prepare.hpp>
#include <revisit/retrieval/place_index.hpp>
#include <revisit/store/keyframe_bytes.hpp>

#include "realistic_places.hpp"

namespace {

using namespace revisit;
namespace fs = std::filesystem;

const Recording& elsewhere() {
  static const std::shared_ptr<const Recording> recording = [] {
    SimulationOptions options;
    options.seed = 105;
    options.frames = 20;
    return std::shared_ptr<const Recording>(*simulate(options));
  }();
  return *recording;
}

// The places of one long street: descriptors of simulated towns, the cloud of one scan for all of them.
void write_map(const fs::path& file, std::size_t count, bool is_finished) {
  const bench::RealisticPlaces places{DescriptorOptions{}};
  ScanPreparation preparation{Parameters{}, std::nullopt, {}, {}};
  const Bytes cloud = to_bytes(preparation.prepare(*elsewhere().read(0))->cloud);
  auto store = *MapStore::create(file);
  PlaceIndex index{RetrievalOptions{}};
  std::vector<StoredMapPose> poses;
  Matrix6 information = Matrix6::Identity();
  Pose T = Pose::Identity(), T_step = Pose::Identity();
  T_step.translation().x() = 1.5;
  Status status = store.set(StoredSession{0, "a street", "", ""});
  for (std::size_t i = 0; status && i < count; ++i, T = T * T_step) {
    const FrameId frame{static_cast<std::int64_t>(i)};
    const double stamp_s = static_cast<double>(i);
    const IntensityScanContext descriptor = places.place(i);
    index.add(frame, stamp_s, descriptor);
    poses.push_back({frame, T, 0});
    status = store.add(StoredKeyframe{frame, stamp_s, T, false, to_bytes(descriptor), cloud, {}});
    if (status && i > 0) status = store.add(StoredEdge{FrameId{frame.value - 1}, frame, T_step, information, {}});
  }
  if (status) status = store.set_map_poses(poses);
  if (status && is_finished)
    status = index.save(
        [&](std::size_t offset, std::span<const std::byte> piece) { return store.add_index(offset, piece); });
  if (status && is_finished) status = store.set_place_poses(poses);
  if (status) status = store.commit();
  if (status) status = store.close();
  if (!status) throw std::runtime_error(status.error().message);
}

void open_map(benchmark::State& state, bool is_finished) {
  const auto count = static_cast<std::size_t>(state.range(0));
  const fs::path file = "out/bench/open_" + std::to_string(count) + (is_finished ? "" : "_unfinished") + ".revisit";
  if (!fs::exists(file)) write_map(file, count, is_finished);
  const Scan query = *elsewhere().read(10);
  double open_ms = 0.0, first_ms = 0.0;
  for (auto _ : state) {
    Stopwatch watch;
    auto localiser = Localiser::open(file);
    if (!localiser) return state.SkipWithError(localiser.error().message.c_str());
    open_ms = watch.lap_ms();
    benchmark::DoNotOptimize(localiser->locate(query));
    first_ms = watch.lap_ms();
    state.PauseTiming();
    localiser = Error{};
    state.ResumeTiming();
  }
  state.counters["open_ms"] = open_ms;
  state.counters["first_answer_ms"] = first_ms;
}

BENCHMARK_CAPTURE(open_map, finished, true)->Arg(5000)->Arg(50000)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK_CAPTURE(open_map, unfinished, false)->Arg(5000)->Arg(50000)->Unit(benchmark::kMillisecond)->UseRealTime();

}  // namespace

BENCHMARK_MAIN();
