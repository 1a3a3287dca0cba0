// SPDX-License-Identifier: Apache-2.0
// Range filter, ground segmentation and description of one scan of about 120,000 points, one thread, beside plain
// double-precision references in the same run. The scan is simulated, or a real one: REVISIT_BENCH_SCAN=FILE.
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <vector>

#include <benchmark/benchmark.h>

#include <revisit/descriptors/intensity_scan_context.hpp>
#include <revisit/io/scan_file.hpp>
#include <revisit/preprocess/ground.hpp>
#include <revisit/preprocess/intensity.hpp>
#include <revisit/preprocess/range_filter.hpp>
#include <revisit/registration/surface_cloud.hpp>
#include <revisit/verification/geometric.hpp>

#include "synthetic_world.hpp"

namespace {

using namespace revisit;

const Scan& bench_scan() {
  static const Scan scan = [] {
    Scan result;
    if (const char* file = std::getenv("REVISIT_BENCH_SCAN")) {
      auto read = read_scan(file);
      if (!read) std::fprintf(stderr, "%s\n", read.error().message.c_str()), std::exit(1);
      result = *std::move(read);
    } else {
      result = testing_support::SyntheticWorld(5, 60.0, 120)
                   .scan(testing_support::SyntheticWorld::at(0, 0, 0), {64, 2000, -24.8, 2.0});
    }
    const auto scale = estimate_intensity_scale(std::span<const Scan>(&result, 1), {});
    normalise_intensity(result, scale);
    return result;
  }();
  return scan;
}

void set_counters(benchmark::State& state) {
  state.counters["points"] = static_cast<double>(bench_scan().points.size());
  state.counters["points_per_s"] = benchmark::Counter(static_cast<double>(bench_scan().points.size()),
                                                      benchmark::Counter::kIsIterationInvariantRate);
}

void filter_and_describe(benchmark::State& state) {
  const Parameters parameters;
  Describer describer(parameters.descriptor);
  IntensityScanContext context;
  Scan scan;
  for (auto _ : state) {
    state.PauseTiming();
    scan = bench_scan();
    state.ResumeTiming();
    filter_range(scan, parameters.preprocess);
    describer.describe(scan.points, context);
    benchmark::DoNotOptimize(context.intensity.data());
  }
  set_counters(state);
}

// The same, point by point in double with the mathematics library, as one would write it first.
void filter_and_describe_plain(benchmark::State& state) {
  const Parameters parameters;
  const int rings = parameters.descriptor.rings, sectors = parameters.descriptor.sectors;
  for (auto _ : state) {
    std::vector<double> cells(static_cast<std::size_t>(rings * sectors), 0.0);
    std::vector<bool> occupied(cells.size(), false);
    std::vector<Point> kept;
    for (const Point& p : bench_scan().points) {
      const double range =
          std::sqrt(static_cast<double>(p.x) * p.x + static_cast<double>(p.y) * p.y + static_cast<double>(p.z) * p.z);
      if (range >= parameters.preprocess.min_range_m && range <= parameters.preprocess.max_range_m) kept.push_back(p);
    }
    for (const Point& p : kept) {
      const double rho = std::sqrt(static_cast<double>(p.x) * p.x + static_cast<double>(p.y) * p.y);
      if (rho >= parameters.descriptor.max_range_m) continue;
      const double theta = std::atan2(static_cast<double>(p.y), static_cast<double>(p.x));
      const int ring = static_cast<int>(rho * rings / parameters.descriptor.max_range_m);
      const int sector = static_cast<int>((theta + kPi) * sectors / (2.0 * kPi)) % sectors;
      const auto cell = static_cast<std::size_t>(sector * rings + ring);
      cells[cell] = std::max(cells[cell], static_cast<double>(p.intensity));
      occupied[cell] = true;
    }
    benchmark::DoNotOptimize(cells.data());
  }
  set_counters(state);
}

void ground_segmentation(benchmark::State& state) {
  const Parameters parameters;
  Scan scan = bench_scan();
  filter_range(scan, parameters.preprocess);
  for (auto _ : state) {
    const auto ground = segment_ground(scan, find_rings(scan), parameters.preprocess);
    benchmark::DoNotOptimize(ground.is_ground.data());
  }
  set_counters(state);
}

// The same rule in double with the mathematics library: angles by atan2, slope as an angle, no cleaning of segments.
void ground_segmentation_plain(benchmark::State& state) {
  const Parameters parameters;
  Scan scan = bench_scan();
  filter_range(scan, parameters.preprocess);
  const Rings rings = find_rings(scan);
  const std::size_t columns = 2000;
  for (auto _ : state) {
    std::vector<std::int32_t> image(rings.count() * columns, -1);
    std::vector<std::uint8_t> is_ground(scan.points.size(), 0);
    for (std::size_t i = 0; i < scan.points.size(); ++i) {
      const Point& p = scan.points[i];
      // A reader of rings from angles pays for both.
      benchmark::DoNotOptimize(
          std::atan2(static_cast<double>(p.z), std::hypot(static_cast<double>(p.x), static_cast<double>(p.y))));
      const double azimuth = std::atan2(static_cast<double>(p.y), static_cast<double>(p.x)) + kPi;
      const auto column = static_cast<std::size_t>(azimuth * static_cast<double>(columns) / (2.0 * kPi)) % columns;
      image[rings.of_point[i] * columns + column] = static_cast<std::int32_t>(i);
    }
    for (std::size_t row = 0; row + 1 < rings.count(); ++row)
      for (std::size_t column = 0; column < columns; ++column) {
        const auto a = image[row * columns + column], b = image[(row + 1) * columns + column];
        if (a < 0 || b < 0) continue;
        const Point &p = scan.points[static_cast<std::size_t>(a)], &q = scan.points[static_cast<std::size_t>(b)];
        const double angle = std::atan2(static_cast<double>(q.z) - p.z,
                                        std::hypot(static_cast<double>(q.x) - p.x, static_cast<double>(q.y) - p.y));
        if (std::abs(to_degrees(angle)) <= GroundConstants::kSlope_deg)
          is_ground[static_cast<std::size_t>(a)] = is_ground[static_cast<std::size_t>(b)] = 1;
      }
    benchmark::DoNotOptimize(is_ground.data());
  }
  set_counters(state);
}

void thin_for_registration(benchmark::State& state) {
  for (auto _ : state) {
    const ThinCloud cloud = thin_for_registration(bench_scan().points, {});
    benchmark::DoNotOptimize(cloud.points.data());
  }
  set_counters(state);
}

BENCHMARK(filter_and_describe)->Unit(benchmark::kMillisecond);
BENCHMARK(filter_and_describe_plain)->Unit(benchmark::kMillisecond);
BENCHMARK(ground_segmentation)->Unit(benchmark::kMillisecond);
BENCHMARK(ground_segmentation_plain)->Unit(benchmark::kMillisecond);
BENCHMARK(thin_for_registration)->Unit(benchmark::kMillisecond);

}  // namespace

BENCHMARK_MAIN();
