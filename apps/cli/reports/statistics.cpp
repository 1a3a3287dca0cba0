// SPDX-License-Identifier: Apache-2.0
#include "reports/statistics.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <numeric>

#include <revisit/pipeline/prepare.hpp>
#include <revisit/pipeline/recording_scale.hpp>
#include <revisit/preprocess/range_filter.hpp>
#include <revisit/preprocess/rings.hpp>

#include "pictures/chart.hpp"

namespace revisit::cli {
namespace {

constexpr std::size_t kSample = 20;
constexpr std::array<Colour, 2> kColours = {{{0.12, 0.35, 0.70}, {0.90, 0.45, 0.05}}};

void count(std::vector<double>& histogram, double position) {
  if (position >= 0.0 && position < static_cast<double>(histogram.size()))
    ++histogram[static_cast<std::size_t>(position)];
}

void divide(std::vector<double>& values, double by) {
  for (double& value : values) value /= std::max(by, 1.0);
}

void draw_histogram(Canvas& canvas, const Box& box, const std::vector<RecordingStatistics>& all,
                    const std::vector<double> RecordingStatistics::*values, double step, double scale,
                    const std::array<const char*, 3>& labels) {
  double most = 0.0;
  std::size_t bins = 0;
  for (const auto& each : all) {
    for (const double value : each.*values) most = std::max(most, value * scale);
    bins = std::max(bins, (each.*values).size());
  }
  Chart chart(canvas, box, {0.0, step * static_cast<double>(bins)}, {0.0, 1.08 * most});
  chart.draw_axes(labels[0], labels[1], labels[2]);
  for (std::size_t k = 0; k < all.size(); ++k) {
    std::vector<Pixel> line;
    const auto& heights = all[k].*values;
    for (std::size_t i = 0; i < heights.size(); ++i)
      for (const double edge : {0.0, 1.0})
        line.push_back(chart.at(step * (static_cast<double>(i) + edge), heights[i] * scale));
    canvas.line(line, kColours[k % kColours.size()], 2.0);
  }
}

}  // namespace

Result<RecordingStatistics> collect_statistics(const Recording& recording, const std::string& name,
                                               const Parameters& parameters) {
  const auto scale = intensity_scale_of(recording, parameters.intensity);
  if (!scale) return scale.error();
  RecordingStatistics result;
  result.name = name;
  result.range_share.resize(40);
  result.intensity_share.resize(38);
  result.cell_share.resize(static_cast<std::size_t>(parameters.descriptor.rings));
  result.cells = static_cast<double>(parameters.descriptor.rings) * parameters.descriptor.sectors *
                 std::max(1, parameters.descriptor.levels);
  const std::size_t wanted = std::min(kSample, recording.size());
  double scans_with_rings = 0.0;
  for (std::size_t k = 0; k < wanted; ++k) {
    auto scan = recording.read(k * recording.size() / wanted);
    if (!scan) continue;  // `info` has named broken scans already
    ++result.scans;
    result.points += static_cast<double>(scan->points.size());
    const Rings rings = find_rings(*scan);
    if (result.ring_points.empty()) result.ring_points.resize(rings.count());
    if (rings.count() > 0 && rings.count() == result.ring_points.size()) {
      ++scans_with_rings;
      for (const std::uint16_t ring : rings.of_point) ++result.ring_points[ring];
    }
    for (const Point& p : scan->points) {
      count(result.range_share, std::sqrt(static_cast<double>(p.x * p.x + p.y * p.y + p.z * p.z)) / kRangeStep_m);
      count(result.intensity_share, static_cast<double>(p.intensity) / scale->full_scale / kIntensityStep);
    }
    filter_range(*scan, parameters.preprocess);
    const auto descriptor = describe(scan->points, parameters.descriptor);
    result.occupied_cells += descriptor.occupied_cells();
    for (int ring = 0; ring < descriptor.rings; ++ring)
      for (int sector = 0; sector < descriptor.sectors; ++sector)
        result.cell_share[static_cast<std::size_t>(ring)] += descriptor.occupied(ring, sector);
  }
  if (result.scans == 0) return Error{name + ": no scan can be read"};
  const auto n = static_cast<double>(result.scans);
  divide(result.range_share, result.points);
  divide(result.intensity_share, result.points);
  divide(result.ring_points, scans_with_rings);
  divide(result.cell_share, n * parameters.descriptor.sectors);
  result.points /= n;
  result.occupied_cells /= n;
  return result;
}

double overlap(const std::vector<double>& a, const std::vector<double>& b) {
  const double sum_a = std::accumulate(a.begin(), a.end(), 0.0), sum_b = std::accumulate(b.begin(), b.end(), 0.0);
  double common = 0.0;
  for (std::size_t i = 0; i < std::min(a.size(), b.size()) && sum_a > 0.0 && sum_b > 0.0; ++i)
    common += std::min(a[i] / sum_a, b[i] / sum_b);
  return common;
}

void print_statistics(const std::vector<RecordingStatistics>& all) {
  std::printf("\n%-28s %8s %10s %16s\n", "mean of scans", "scans", "points", "occupied cells");
  for (const auto& each : all)
    std::printf("%-28s %8zu %10.0f %8.0f of %4.0f\n", each.name.c_str(), each.scans, each.points, each.occupied_cells,
                each.cells);
  if (all.size() < 2) return;
  std::printf("overlap of the histograms: points a ring %.2f, range %.2f, intensity %.2f, occupied cells a ring %.2f\n",
              overlap(all[0].ring_points, all[1].ring_points), overlap(all[0].range_share, all[1].range_share),
              overlap(all[0].intensity_share, all[1].intensity_share), overlap(all[0].cell_share, all[1].cell_share));
}

Status draw_statistics(const std::filesystem::path& file, const std::vector<RecordingStatistics>& all) {
  Canvas canvas(1560, 1010);
  const Box a{100, 90, 620, 340}, b{880, 90, 620, 340}, c{100, 560, 620, 340}, d{880, 560, 620, 340};
  using S = RecordingStatistics;
  draw_histogram(canvas, a, all, &S::ring_points, 1.0, 1.0,
                 {"points of each laser ring", "ring, from the lowest", "points a scan"});
  draw_histogram(canvas, b, all, &S::range_share, kRangeStep_m, 100.0,
                 {"how far the points are", "range (m)", "% of the points"});
  draw_histogram(canvas, c, all, &S::intensity_share, kIntensityStep, 100.0,
                 {"how bright the points are", "intensity (full scale = 1)", "% of the points"});
  draw_histogram(canvas, d, all, &S::cell_share, 1.0, 100.0,
                 {"occupied cells of the descriptor", "ring of the grid, from the middle", "% of the ring's cells"});
  for (std::size_t k = 0; k < all.size(); ++k) {
    const double x = 100 + 780.0 * static_cast<double>(k);
    char text[256];
    std::snprintf(text, sizeof text, "%s: %zu scans, %.0f points, %.0f of %.0f cells occupied", all[k].name.c_str(),
                  all[k].scans, all[k].points, all[k].occupied_cells, all[k].cells);
    canvas.line({{x, 25}, {x + 30, 25}}, kColours[k % kColours.size()], 4);
    canvas.text({x + 40, 25}, text, 15);
  }
  return canvas.save_png(file);
}

}  // namespace revisit::cli
