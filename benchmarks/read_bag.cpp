// SPDX-License-Identifier: Apache-2.0
// Reading the clouds of a ROS 1 bag: ROS's own library gives their bytes, and so does ours; then the scans in them.
#include <benchmark/benchmark.h>

#include <revisit/io/bag_writer.hpp>
#include <revisit/io/internal/bag.hpp>
#include <revisit/io/recording.hpp>

#include "rosbag_reader.hpp"

namespace {

namespace fs = std::filesystem;
using namespace revisit;

// 100 clouds of 60,000 points with rings and times, once a run.
const std::string& drive(const char* ending) {
  static std::map<std::string, std::string> files;
  std::string& file = files[ending];
  if (!file.empty()) return file;
  file = (fs::temp_directory_path() / ("revisit_bench" + std::string(ending))).string();
  fs::remove(file);
  auto writer = BagWriter::create(file);
  Scan scan;
  for (int i = 0; i < 60'000; ++i) {
    const float angle = 1e-3f * static_cast<float>(i);
    scan.points.push_back({20.f * std::cos(angle), 20.f * std::sin(angle), 0.1f * static_cast<float>(i % 64),
                           static_cast<float>(i % 251)});
    scan.rings.push_back(static_cast<std::uint16_t>(i % 64));
    scan.times_s.push_back(1.6e-6f * static_cast<float>(i));
  }
  for (int i = 0; i < 100; ++i) {
    scan.stamp_s = 0.1 * i;
    if (!writer->write_scan("/points", "lidar", scan)) std::abort();
  }
  if (!writer->finish()) std::abort();
  return file;
}

void messages_with_rosbag(benchmark::State& state) {
  const std::string& file = drive(".bag");
  for (auto _ : state) benchmark::DoNotOptimize(read_clouds_with_rosbag(file));
}
BENCHMARK(messages_with_rosbag)->Unit(benchmark::kMillisecond);

void messages_with_revisit(benchmark::State& state) {
  const std::string& file = drive(".bag");
  for (auto _ : state) {
    const auto bag = io_internal::Bag::open(file, {});
    std::size_t bytes = 0;
    for (std::uint64_t i = 0; i < (*bag)->topics()[0].messages; ++i) {
      const auto message = (*bag)->read(0, i);
      bytes += (*bag)->decode(0, *message)->block("data").size();
    }
    benchmark::DoNotOptimize(bytes);
  }
}
BENCHMARK(messages_with_revisit)->Unit(benchmark::kMillisecond);

void scans_with_revisit(benchmark::State& state, const char* ending) {
  const std::string& file = drive(ending);
  for (auto _ : state) {
    const auto recording = open_recording(file);
    std::size_t points = 0;
    for (std::size_t i = 0; i < (*recording)->size(); ++i) points += (*recording)->read(i)->points.size();
    benchmark::DoNotOptimize(points);
  }
}
BENCHMARK_CAPTURE(scans_with_revisit, bag, ".bag")->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(scans_with_revisit, mcap, ".mcap")->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(scans_with_revisit, db3, ".db3")->Unit(benchmark::kMillisecond);

}  // namespace

BENCHMARK_MAIN();
