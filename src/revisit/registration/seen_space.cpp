// SPDX-License-Identifier: Apache-2.0
#include <revisit/registration/seen_space.hpp>

#include <algorithm>
#include <cmath>
#include <optional>

#include <revisit/core/fast_math.hpp>
#include <revisit/core/pose.hpp>

namespace revisit {
namespace {

constexpr int kAzimuths = 120, kElevations = 30;
constexpr auto kCellsARad = static_cast<float>(kAzimuths / (2.0 * kPi));

// An angle in cells: quickly, and exactly where it comes near to a border.
float in_cells(float y, float x, float offset_rad) {
  constexpr float kNear = 1e-3f;  // cells; more than the quick one may be off
  const float quick = (approximate_atan2(y, x) + offset_rad) * kCellsARad;
  const float within = quick - static_cast<float>(floor_to_int(quick));
  return within > kNear && within < 1.f - kNear ? quick : (std::atan2(y, x) + offset_rad) * kCellsARad;
}

std::optional<std::size_t> cell_of(float x, float y, float z) {
  const float elevation = in_cells(z, std::sqrt(x * x + y * y), kElevations / 2.f / kCellsARad);
  if (!(elevation >= 0.f && elevation < kElevations)) return std::nullopt;
  const float azimuth = in_cells(y, x, static_cast<float>(kPi));
  const int column = static_cast<int>(azimuth) % kAzimuths;
  return static_cast<std::size_t>(column * kElevations + static_cast<int>(elevation));
}

}  // namespace

SeenSpace::SeenSpace(std::span<const Point> points) : cells_(std::size_t{kAzimuths} * kElevations) {
  for (const Point& p : points) {
    const auto cell = cell_of(p.x, p.y, p.z);
    if (!cell) continue;
    const float range_cm = 100.f * std::sqrt(p.x * p.x + p.y * p.y + p.z * p.z);
    const auto range = static_cast<std::uint16_t>(std::min(range_cm, 65534.f));
    Interval& interval = cells_[*cell];
    interval.nearest_cm = std::min(interval.nearest_cm, range);
    interval.farthest_cm = std::max(interval.farthest_cm, range);
  }
}

SeenSpace::Verdict SeenSpace::look(const Eigen::Vector3f& p, float margin_m) const {
  const auto cell = cells_.empty() ? std::nullopt : cell_of(p.x(), p.y(), p.z());
  if (!cell || cells_[*cell].farthest_cm == 0) return Verdict::kUnknown;
  const float range_m = p.norm();
  if (range_m < 0.01f * cells_[*cell].nearest_cm - margin_m) return Verdict::kThrough;
  if (range_m > 0.01f * cells_[*cell].farthest_cm + margin_m) return Verdict::kHidden;
  return Verdict::kSurface;
}

double SeenSpace::share_of_horizon() const {
  if (cells_.empty()) return 1.0;
  int seen = 0;
  for (auto column = cells_.begin(); column != cells_.end(); column += kElevations)
    seen += std::any_of(column, column + kElevations, [](const Interval& cell) { return cell.farthest_cm != 0; });
  return static_cast<double>(seen) / kAzimuths;
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
