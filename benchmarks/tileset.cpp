// SPDX-License-Identifier: Apache-2.0
// Writing a map for viewers: 10 million points as 3D Tiles, against the same points as one PLY.
#include <benchmark/benchmark.h>

#include <filesystem>
#include <fstream>
#include <random>
#include <string>
#include <vector>

#include <revisit/mapping/cloud_file.hpp>
#include <revisit/mapping/tileset_writer.hpp>

namespace {

namespace fs = std::filesystem;
using revisit::MapPoint;
using revisit::TilesetWriter;

constexpr double kVoxel_m = 0.2;
constexpr int kPointsASquare = 160'000;

fs::path fresh_folder() {
  const fs::path folder = fs::temp_directory_path() / "revisit_bench_tileset";
  fs::remove_all(folder);
  fs::create_directories(folder);
  return folder;
}

// Ground and walls, about as full as a street of a town.
TilesetWriter::Square square_at(std::uint32_t x, std::uint32_t y) {
  TilesetWriter::Square square{x, y, {}};
  std::mt19937 random(7);
  std::uniform_real_distribution<float> side(0.f, static_cast<float>(TilesetWriter::square_m(kVoxel_m))),
      height(0.f, 10.f);
  const auto corner_x = static_cast<float>(x * TilesetWriter::square_m(kVoxel_m));
  const auto corner_y = static_cast<float>(y * TilesetWriter::square_m(kVoxel_m));
  for (int i = 0; i < kPointsASquare; ++i) {
    const bool is_wall = i % 2 == 0;
    square.points.push_back({corner_x + side(random), corner_y + (is_wall ? 12.f : side(random)),
                             is_wall ? height(random) : 0.f, 0.5f, 0, 0});
  }
  return square;
}

std::size_t resident_mb() {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);)
    if (line.starts_with("VmRSS")) return std::stoul(line.substr(6)) / 1024;
  return 0;
}

void tiles(benchmark::State& state) {
  const auto side = static_cast<std::uint32_t>(state.range(0));  // of the map, squares
  const double side_m = side * TilesetWriter::square_m(kVoxel_m) - 1.0;
  std::size_t points = 0;
  for (auto _ : state) {
    const fs::path folder = fresh_folder();
    TilesetWriter writer(folder, {{0, 0, 0}, {side_m, side_m, 10.0}, kVoxel_m});
    std::vector<std::pair<std::uint64_t, TilesetWriter::Square>> order;
    for (std::uint32_t x = 0; x < side; ++x)
      for (std::uint32_t y = 0; y < side; ++y) order.push_back({TilesetWriter::order(x, y), {x, y, {}}});
    std::sort(order.begin(), order.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
    for (std::size_t i = 0; i < order.size(); i += 8) {
      state.PauseTiming();
      std::vector<TilesetWriter::Square> squares;
      for (std::size_t k = i; k < std::min(i + 8, order.size()); ++k)
        squares.push_back(square_at(order[k].second.x, order[k].second.y));
      state.ResumeTiming();
      if (!writer.add(squares)) state.SkipWithError("cannot write");
    }
    if (!writer.finish()) state.SkipWithError("cannot write");
    points += writer.points();
  }
  state.counters["points/s"] = benchmark::Counter(static_cast<double>(points), benchmark::Counter::kIsRate);
  state.counters["memory_MB"] = static_cast<double>(resident_mb());
}

void ply(benchmark::State& state) {
  const auto squares = static_cast<std::size_t>(state.range(0) * state.range(0));
  const auto square = square_at(0, 0);
  std::vector<revisit::Point> points;
  for (const MapPoint& p : square.points) points.push_back({p.x, p.y, p.z, p.intensity});
  for (auto _ : state) {
    revisit::CloudFile file(fresh_folder() / "map.ply", revisit::CloudFormat::kPly, squares * points.size());
    for (std::size_t i = 0; i < squares; ++i) file.add(points);
    if (!file.finish()) state.SkipWithError("cannot write");
  }
  state.counters["points/s"] =
      benchmark::Counter(static_cast<double>(squares * points.size() * static_cast<std::size_t>(state.iterations())),
                         benchmark::Counter::kIsRate);
}

// 2.6, 10 and 100 million points: memory stays as it is.
BENCHMARK(tiles)->Arg(4)->Arg(8)->Arg(25)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK(ply)->Arg(8)->Unit(benchmark::kMillisecond)->UseRealTime();

}  // namespace

BENCHMARK_MAIN();
