// SPDX-License-Identifier: Apache-2.0
#include <revisit/registration/seen_space.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include <revisit/core/fast_math.hpp>
#include <revisit/core/pose.hpp>

namespace revisit {
namespace {

constexpr int kAzimuths = 120, kElevations = 30;
constexpr int kWidestGap = kAzimuths / 4;  // of a sensor that sees all round: what stands close by hides nothing wider

struct Roof {
  static constexpr std::size_t kLower = kAzimuths * 9 / 10;  ///< of the azimuths, sorted: where the sensor's limit is
  static constexpr int kLeast = kElevations / 2 + 3;         ///< cells below that limit: 9 degrees up, or more
  static constexpr int kFewest = kAzimuths * 95 / 100;       ///< azimuths seen up to the limit, or a cell less
};

// Simulated rooms and halls (seeds 1821 and 1822, sensors that see all round) are closed in all azimuths in 98 scans of
// a hundred, streets of which nothing is seen beyond 25 m in 30 to 85 % of them.
constexpr int kAboveHorizontal = 2;  // cells of elevation
constexpr double kClosed = 0.875;    // share of azimuths

constexpr auto kCellsARad = static_cast<float>(kAzimuths / (2.0 * kPi));

// Angles in cells, counted from the left and from below.
struct Direction {
  float azimuth, elevation;
};

Direction quick_direction(float x, float y, float z) {
  return {(approximate_atan2(y, x) + static_cast<float>(kPi)) * kCellsARad,
          approximate_atan2(z, std::sqrt(x * x + y * y)) * kCellsARad + kElevations / 2.f};
}

// The cell of a direction that is known quickly; where that is near to a border, exactly.
std::optional<std::size_t> cell_of(Direction at, float x, float y, float z) {
  constexpr float kNear = 1e-3f;  // cells; more than the quick one may be off
  const auto is_near_border = [](float cells) {
    const float within = cells - static_cast<float>(floor_to_int(cells));
    return within < kNear || within > 1.f - kNear;
  };
  if (is_near_border(at.azimuth)) at.azimuth = (std::atan2(y, x) + static_cast<float>(kPi)) * kCellsARad;
  if (is_near_border(at.elevation))
    at.elevation = (std::atan2(z, std::sqrt(x * x + y * y)) + kElevations / 2.f / kCellsARad) * kCellsARad;
  if (!(at.elevation >= 0.f && at.elevation < kElevations)) return std::nullopt;
  const int column = static_cast<int>(at.azimuth) % kAzimuths;
  return static_cast<std::size_t>(column * kElevations + static_cast<int>(at.elevation));
}

}  // namespace

SeenSpace::SeenSpace(std::span<const Point> points) : cells_(kCells) {
  static_assert(kCells == std::size_t{kAzimuths} * kElevations);
  // Directions first, in a loop that becomes SIMD.
  constexpr std::size_t kBlock = 256;
  std::array<Direction, kBlock> directions;
  std::array<float, kBlock> ranges_cm;
  for (; !points.empty(); points = points.subspan(std::min(kBlock, points.size()))) {
    const std::size_t count = std::min(kBlock, points.size());
    for (std::size_t i = 0; i < count; ++i) {
      const Point& p = points[i];
      directions[i] = quick_direction(p.x, p.y, p.z);
      ranges_cm[i] = std::min(100.f * std::sqrt(p.x * p.x + p.y * p.y + p.z * p.z), 65534.f);
    }
    for (std::size_t i = 0; i < count; ++i) {
      const auto cell = cell_of(directions[i], points[i].x, points[i].y, points[i].z);
      if (!cell) continue;
      const auto range = static_cast<std::uint16_t>(ranges_cm[i]);
      Interval& interval = cells_[*cell];
      interval.nearest_cm = std::min(interval.nearest_cm, range);
      interval.farthest_cm = std::max(interval.farthest_cm, range);
    }
  }
}

void SeenSpace::add(const SeenSpace& other) {
  if (cells_.empty()) cells_.resize(other.cells_.size());
  for (std::size_t i = 0; i < other.cells_.size(); ++i) {
    cells_[i].nearest_cm = std::min(cells_[i].nearest_cm, other.cells_[i].nearest_cm);
    cells_[i].farthest_cm = std::max(cells_[i].farthest_cm, other.cells_[i].farthest_cm);
  }
}

SeenSpace::Verdict SeenSpace::look(const Eigen::Vector3f& p, float margin_m) const {
  const auto cell = cells_.empty() ? std::nullopt : cell_of(quick_direction(p.x(), p.y(), p.z()), p.x(), p.y(), p.z());
  if (!cell || cells_[*cell].farthest_cm == 0) return Verdict::kUnknown;
  const float range_m = p.norm();
  if (range_m < 0.01f * cells_[*cell].nearest_cm - margin_m) return Verdict::kThrough;
  if (range_m > 0.01f * cells_[*cell].farthest_cm + margin_m) return Verdict::kHidden;
  return Verdict::kSurface;
}

SeenSpace::Sector SeenSpace::sector() const {
  const auto is_seen = [&](int azimuth) {
    const auto first = cells_.begin() + std::ptrdiff_t{azimuth % kAzimuths} * kElevations;
    return std::any_of(first, first + kElevations, [](const Interval& cell) { return cell.farthest_cm > 0; });
  };
  // The widest gap, from a column that was seen once round to it again.
  int first_seen = 0;
  while (first_seen < kAzimuths && (cells_.empty() || !is_seen(first_seen))) ++first_seen;
  if (first_seen == kAzimuths) return {};
  int widest = 0, sector_begins = 0, gap = 0;
  for (int azimuth = first_seen + 1; azimuth <= first_seen + kAzimuths; ++azimuth) {
    if (!is_seen(azimuth)) {
      ++gap;
      continue;
    }
    if (gap > widest) widest = gap, sector_begins = azimuth;
    gap = 0;
  }
  if (widest < kWidestGap) return {};
  const float half = 0.5f * static_cast<float>(kAzimuths - widest);
  const float middle_rad = (static_cast<float>(sector_begins) + half) / kCellsARad - static_cast<float>(kPi);
  return {{std::cos(middle_rad), std::sin(middle_rad)}, std::cos(half / kCellsARad), 2.f * half / kCellsARad};
}

bool SeenSpace::is_roofed() const {
  if (cells_.empty()) return false;
  std::array<int, kAzimuths> highest{};  // cells up to the highest one that was seen
  for (std::size_t i = 0; i < kCells; ++i)
    if (cells_[i].farthest_cm > 0) highest[i / kElevations] = static_cast<int>(i % kElevations) + 1;
  std::array<int, kAzimuths> sorted = highest;
  std::nth_element(sorted.begin(), sorted.begin() + Roof::kLower, sorted.end());
  const int top = sorted[Roof::kLower];
  return top > Roof::kLeast &&
         std::count_if(highest.begin(), highest.end(), [&](int each) { return each >= top - 1; }) >= Roof::kFewest;
}

bool SeenSpace::is_open_to_the_sides() const {
  int seen = 0, closed = 0;
  for (auto column = cells_.begin(); column != cells_.end(); column += kElevations) {
    const auto comes_back = [](const Interval& cell) { return cell.farthest_cm > 0; };
    const auto above = column + kElevations / 2;
    seen += std::any_of(column, column + kElevations, comes_back) ? 1 : 0;
    closed += std::any_of(above, above + kAboveHorizontal, comes_back) ? 1 : 0;
  }
  return closed < kClosed * seen;
}

std::vector<std::uint16_t> SeenSpace::ranges_cm() const {
  std::vector<std::uint16_t> ranges;
  ranges.reserve(2 * cells_.size());
  for (const Interval& cell : cells_) ranges.insert(ranges.end(), {cell.nearest_cm, cell.farthest_cm});
  return ranges;
}

std::optional<SeenSpace> SeenSpace::from_ranges_cm(std::span<const std::uint16_t> ranges) {
  SeenSpace seen;
  if (ranges.empty()) return seen;
  if (ranges.size() != std::size_t{2} * kAzimuths * kElevations) return std::nullopt;
  for (std::size_t i = 0; i < ranges.size(); i += 2) seen.cells_.push_back({ranges[i], ranges[i + 1]});
  return seen;
}

}  // namespace revisit
