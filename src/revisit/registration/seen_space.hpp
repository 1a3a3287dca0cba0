// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include <revisit/core/scan.hpp>

namespace revisit {

/// How far a scan saw in each direction: cells of 3 x 3 degrees, from 45 degrees below to 45 above. Tells whether a
/// point of another scan stands where this one saw through, or where it could not see.
class SeenSpace {
 public:
  enum class Verdict : std::uint8_t {
    kUnknown,  ///< nothing came back from that direction
    kThrough,  ///< everything seen there lies beyond: nothing stood at the point
    kSurface,  ///< something was seen at about that range
    kHidden    ///< the point lies behind all that was seen there
  };

  SeenSpace() = default;
  /// `points` are finite, in the LiDAR's frame.
  explicit SeenSpace(std::span<const Point> points);

  /// From now on also what `other`, of the same frame, saw.
  void add(const SeenSpace& other);

  /// `p`, finite, in the scan's frame; `margin_m` is what the ranges may be off.
  Verdict look(const Eigen::Vector3f& p, float margin_m) const;

  /// The azimuths that the scan saw, about the LiDAR's z axis: all, unless a quarter turn or more of them is empty.
  struct Sector {
    Eigen::Vector2f middle = Eigen::Vector2f::UnitX();  ///< unit vector
    float least_cosine = -1.f;                          ///< of the angle between it and what was seen
    float width_rad = 6.2831853f;

    bool is_all_round() const { return least_cosine <= -1.f; }
    bool is_narrow() const { return width_rad < 3.14f; }  ///< less than half of what is around
    bool holds(const Eigen::Vector2f& p) const { return is_all_round() || p.dot(middle) >= least_cosine * p.norm(); }
  };
  Sector sector() const;

  /// Something was seen overhead all round: in nearly every azimuth the beams that look up farthest, 9 degrees and
  /// more, came back. False for a sensor that does not look up so far.
  bool is_roofed() const;
  /// In more than one of eight azimuths that were seen, nothing came back from 0 to 6 degrees above the LiDAR's xy
  /// plane: what stands there, if anything, is beyond its reach. In rooms walls come back.
  bool is_open_to_the_sides() const;

  void archive(auto& fields) {
    fields(cells_);
    fields.require(cells_.empty() || cells_.size() == kCells);
  }

  /// Nearest and farthest range of each cell in turn, cm, to be kept; empty where nothing was seen.
  std::vector<std::uint16_t> ranges_cm() const;
  /// Nothing where they are not those of all cells.
  static std::optional<SeenSpace> from_ranges_cm(std::span<const std::uint16_t> ranges);

 private:
  static constexpr std::size_t kCells = 3600;
  struct Interval {
    std::uint16_t nearest_cm = UINT16_MAX, farthest_cm = 0;

    void archive(auto& fields) { fields(nearest_cm, farthest_cm); }
  };
  std::vector<Interval> cells_;  ///< [azimuth][elevation]; empty: nothing was seen
};

}  // namespace revisit
