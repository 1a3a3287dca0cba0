// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <revisit/io/recording.hpp>
#include <revisit/preprocess/intensity.hpp>

namespace revisit::cli {

/// How the scans of a recording look on average, so that two recordings (a simulated and a real one) can be compared.
struct RecordingStatistics {
  std::string name;
  std::size_t scans = 0;
  double points = 0.0;          ///< of a scan
  double occupied_cells = 0.0;  ///< of a descriptor, at the parameters' grid
  double cells = 0.0;
  std::vector<double> ring_points;      ///< of a scan, from the lowest ring
  std::vector<double> range_share;      ///< of the points, in steps of 2 m
  std::vector<double> intensity_share;  ///< of the points, in steps of 0.04 full scales
  std::vector<double> cell_share;       ///< occupied cells of each ring of the descriptor, as a share
};
inline constexpr double kRangeStep_m = 2.0, kIntensityStep = 0.04;

/// From up to 20 scans spread over the recording.
Result<RecordingStatistics> collect_statistics(const Recording& recording, const std::string& name,
                                               const Parameters& parameters);
/// The share that two histograms have in common: 1 if they are alike, 0 if they have nothing in common.
double overlap(const std::vector<double>& a, const std::vector<double>& b);
void print_statistics(const std::vector<RecordingStatistics>& all);
Status draw_statistics(const std::filesystem::path& file, const std::vector<RecordingStatistics>& all);

}  // namespace revisit::cli
