// SPDX-License-Identifier: Apache-2.0
#include <revisit/preprocess/rings.hpp>

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <optional>

#include <revisit/core/fast_math.hpp>
#include <revisit/core/pose.hpp>

namespace revisit {
namespace {

// Chosen on real scans of eleven sensors (16 to 128 lines) and on KITTI's.
struct Lines {
  static constexpr std::size_t kMostRings = 256;
  static constexpr std::size_t kFewestPoints = 200;  ///< of a scan whose rings are worth looking for
  // From the order of the points:
  static constexpr std::size_t kFewestTurns = 8;
  static constexpr std::size_t kStragglers = 20;  ///< points past the start of a turn that are no turn of their own
  // From the histogram of elevations:
  static constexpr std::size_t kBins = 3600;
  static constexpr double kBin_rad = 0.05 / 180.0 * kPi;
  static constexpr double kFaintest = 8.0;  ///< points at the maximum of a line
  static constexpr double kEcho = 0.15;     ///< of the fuller line beside it: a mere echo
  static constexpr std::size_t kFewestLines = 4;
  static constexpr double kShareNearLines = 0.8;  ///< 0.5 where elevations are spread evenly
  static constexpr double kClose = 0.35;          ///< of the median gap around: the fainter of two is no line
  static constexpr double kStraggler = 0.35;      ///< of the points of the line beside the outermost
  static constexpr double kWider = 1.5;           ///< gap of an outermost line that is sparse by design
};

// Elevation of each point, radians.
std::vector<float> elevations_of(const Scan& scan) {
  std::vector<float> elevations(scan.points.size());
  for (std::size_t i = 0; i < elevations.size(); ++i) {
    const Point& p = scan.points[i];
    elevations[i] = approximate_atan2(p.z, std::sqrt(p.x * p.x + p.y * p.y));
  }
  return elevations;
}

// Renumbers labels [0, count) by the mean elevation of their points; labels without points vanish.
Rings number_by_elevation(const std::vector<float>& elevations, const std::vector<std::uint16_t>& labels,
                          std::size_t count, RingSource source) {
  std::vector<double> sums(count, 0.0);
  std::vector<std::size_t> sizes(count, 0);
  for (std::size_t i = 0; i < labels.size(); ++i) {
    sums[labels[i]] += elevations[i];
    ++sizes[labels[i]];
  }
  std::vector<std::uint16_t> order;
  for (std::size_t label = 0; label < count; ++label)
    if (sizes[label] > 0) order.push_back(static_cast<std::uint16_t>(label));
  const auto mean = [&](std::uint16_t label) { return sums[label] / static_cast<double>(sizes[label]); };
  std::stable_sort(order.begin(), order.end(), [&](auto a, auto b) { return mean(a) < mean(b); });
  std::vector<std::uint16_t> ring_of_label(count, 0);
  Rings rings;
  rings.source = source;
  for (std::size_t ring = 0; ring < order.size(); ++ring) {
    ring_of_label[order[ring]] = static_cast<std::uint16_t>(ring);
    rings.elevations_rad.push_back(static_cast<float>(mean(order[ring])));
  }
  rings.of_point.resize(labels.size());
  for (std::size_t i = 0; i < labels.size(); ++i) rings.of_point[i] = ring_of_label[labels[i]];
  return rings;
}

// KITTI's files hold ring after ring, each a turn that starts straight ahead: y jumps from negative to positive ahead
// of the sensor. The turns are rings if there are enough of them and their mean elevation runs one way.
std::optional<Rings> rings_from_order(const Scan& scan, const std::vector<float>& elevations) {
  std::vector<std::uint16_t> labels(scan.points.size());
  std::vector<double> means;
  bool behind_seen = false;  // noise around the start must not count as a turn
  std::size_t turn_begin = 0;
  float sum = 0.f;
  const auto end_turn = [&](std::size_t end) {
    if (end - turn_begin < Lines::kStragglers && !means.empty()) {
      std::fill(labels.begin() + static_cast<std::ptrdiff_t>(turn_begin),
                labels.begin() + static_cast<std::ptrdiff_t>(end), static_cast<std::uint16_t>(means.size() - 1));
      return;
    }
    means.push_back(static_cast<double>(sum) / static_cast<double>(end - turn_begin));
  };
  for (std::size_t i = 0; i < scan.points.size(); ++i) {
    const Point& p = scan.points[i];
    behind_seen |= p.x < 0.f;
    if (behind_seen && p.x > 0.f && p.y >= 0.f && scan.points[i - 1].x > 0.f && scan.points[i - 1].y < 0.f) {
      if (means.size() + 1 == Lines::kMostRings) return std::nullopt;
      end_turn(i);
      turn_begin = i;
      sum = 0.f;
      behind_seen = false;
    }
    labels[i] = static_cast<std::uint16_t>(means.size());
    sum += elevations[i];
  }
  end_turn(scan.points.size());
  if (means.size() < Lines::kFewestTurns) return std::nullopt;
  std::size_t falling = 0;
  for (std::size_t i = 1; i < means.size(); ++i) falling += means[i] < means[i - 1];
  const double one_way = static_cast<double>(std::max(falling, means.size() - 1 - falling));
  if (one_way < 0.9 * static_cast<double>(means.size() - 1)) return std::nullopt;
  return number_by_elevation(elevations, labels, means.size(), RingSource::kOrder);
}

// Lines in the histogram of elevations: maxima that stand clear of the valleys beside them, and are no mere echo of a
// much fuller line next to them.
std::vector<double> find_lines(const std::vector<double>& histogram) {
  std::vector<std::size_t> peaks;
  std::size_t rising = 0;
  double peak = 0.0, valley = 0.0;  // peak: of the line being climbed, 0 between lines
  for (std::size_t i = 0; i < histogram.size(); ++i) {
    const double value = histogram[i];
    if (value > 2.0 * valley && value >= Lines::kFaintest && value > peak) {
      rising = i;
      peak = value;
    }
    if (value < 0.5 * peak) {
      peaks.push_back(rising);
      peak = 0.0;
      valley = value;
    }
    if (peak == 0.0) valley = std::min(valley, value);
  }
  std::vector<double> lines;
  for (std::size_t i = 0; i < peaks.size(); ++i) {
    const double below = i > 0 ? histogram[peaks[i - 1]] : 0.0;
    const double above = i + 1 < peaks.size() ? histogram[peaks[i + 1]] : 0.0;
    if (histogram[peaks[i]] >= Lines::kEcho * std::max(below, above)) lines.push_back(static_cast<double>(peaks[i]));
  }
  return lines;
}

// Leaves out what is no line of its own: the fainter of two that stand much closer than those around them (beams whose
// origins lie apart show near surfaces beside their line), and stragglers beyond the outermost line.
std::vector<double> without_doubles(std::vector<double> lines, const std::vector<double>& histogram) {
  const auto points = [&](std::size_t i) { return histogram[static_cast<std::size_t>(lines[i])]; };
  const auto remove = [&](std::size_t i) { lines.erase(lines.begin() + static_cast<std::ptrdiff_t>(i)); };
  for (std::size_t i = 0; i + 1 < lines.size();) {
    std::vector<double> around;
    for (std::size_t j = i < 3 ? 0 : i - 3; j <= i + 3 && j + 1 < lines.size(); ++j)
      if (j != i) around.push_back(lines[j + 1] - lines[j]);
    if (around.size() < 3) break;
    const auto median = around.begin() + static_cast<std::ptrdiff_t>(around.size() / 2);
    std::nth_element(around.begin(), median, around.end());
    if (lines[i + 1] - lines[i] < Lines::kClose * *median)
      remove(points(i) < points(i + 1) ? i : i + 1);
    else
      ++i;
  }
  // A sensor whose lines spread towards the edge has few points on the outermost, but at a wider gap.
  const auto is_straggler = [&](std::size_t outer, std::size_t inner, std::size_t third) {
    return points(outer) < Lines::kStraggler * points(inner) &&
           std::abs(lines[outer] - lines[inner]) < Lines::kWider * 0.5 * std::abs(lines[inner] - lines[third]);
  };
  if (const std::size_t n = lines.size(); n > 3 && is_straggler(n - 1, n - 2, n - 4)) remove(n - 1);
  if (lines.size() > 3 && is_straggler(0, 1, 3)) remove(0);
  return lines;
}

std::optional<Rings> rings_from_elevation(const std::vector<float>& elevations) {
  std::vector<double> histogram(Lines::kBins, 0.0);
  std::vector<std::uint16_t> bin_of(elevations.size());
  for (std::size_t i = 0; i < elevations.size(); ++i) {
    const auto bin = static_cast<std::int32_t>((elevations[i] + static_cast<float>(kPi / 2)) *
                                               static_cast<float>(1.0 / Lines::kBin_rad));
    bin_of[i] = static_cast<std::uint16_t>(std::clamp<std::int32_t>(bin, 0, Lines::kBins - 1));
  }
  for (const std::uint16_t bin : bin_of) histogram[bin] += 1.0;
  // A line on the border of two bins must not look like two lines.
  std::vector<double> smooth(Lines::kBins, 0.0);
  for (std::size_t i = 1; i + 1 < Lines::kBins; ++i)
    smooth[i] = histogram[i - 1] + 2.0 * histogram[i] + histogram[i + 1];
  const std::vector<double> lines = without_doubles(find_lines(smooth), smooth);
  if (lines.size() < Lines::kFewestLines || lines.size() > Lines::kMostRings) return std::nullopt;

  // Each bin belongs to the nearest line. True lines hold most points within a quarter of the gap to their
  // neighbours, or the neighbouring bins.
  std::vector<std::uint16_t> line_of_bin(Lines::kBins);
  std::size_t nearest = 0;
  double near_points = 0.0;
  for (std::size_t bin = 0; bin < Lines::kBins; ++bin) {
    const auto at = static_cast<double>(bin);
    while (nearest + 1 < lines.size() && lines[nearest + 1] - at < at - lines[nearest]) ++nearest;
    line_of_bin[bin] = static_cast<std::uint16_t>(nearest);
    const double below = nearest > 0 ? lines[nearest] - lines[nearest - 1] : lines[1] - lines[0];
    const double above = nearest + 1 < lines.size() ? lines[nearest + 1] - lines[nearest] : below;
    const double reach = std::max(1.5, 0.25 * (at < lines[nearest] ? below : above));
    if (std::abs(at - lines[nearest]) <= reach) near_points += histogram[bin];
  }
  if (near_points < Lines::kShareNearLines * static_cast<double>(elevations.size())) return std::nullopt;
  std::vector<std::uint16_t> labels(elevations.size());
  for (std::size_t i = 0; i < labels.size(); ++i) labels[i] = line_of_bin[bin_of[i]];
  return number_by_elevation(elevations, labels, lines.size(), RingSource::kElevation);
}

}  // namespace

std::string to_string(RingSource source) {
  switch (source) {
    case RingSource::kFile:
      return "named by the file";
    case RingSource::kOrder:
      return "recovered from the order of the points";
    case RingSource::kElevation:
      return "recovered from elevation angles";
    case RingSource::kNone:
      break;
  }
  return "none";
}

Rings find_rings(const Scan& scan) {
  const std::vector<float> elevations = elevations_of(scan);
  if (scan.rings.size() == scan.points.size() && !scan.rings.empty()) {
    const auto largest = *std::max_element(scan.rings.begin(), scan.rings.end());
    return number_by_elevation(elevations, scan.rings, std::size_t{largest} + 1, RingSource::kFile);
  }
  if (scan.points.size() < Lines::kFewestPoints) return {};
  if (auto rings = rings_from_elevation(elevations)) return *std::move(rings);
  if (auto rings = rings_from_order(scan, elevations)) return *std::move(rings);
  return {};
}

void turn_over(Rings& rings) {
  const auto last = static_cast<int>(rings.count()) - 1;
  for (std::uint16_t& ring : rings.of_point) ring = static_cast<std::uint16_t>(last - ring);
  std::reverse(rings.elevations_rad.begin(), rings.elevations_rad.end());
  for (float& elevation_rad : rings.elevations_rad) elevation_rad = -elevation_rad;
}

}  // namespace revisit
