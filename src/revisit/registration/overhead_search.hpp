// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <vector>

#include <revisit/core/pose.hpp>
#include <revisit/registration/surface_cloud.hpp>

namespace revisit {

/// What stands above the ground, seen from overhead: 128 x 128 cells of one bit, as wide as voxels, the sensor in the
/// middle.
struct OverheadImage {
  static constexpr int kSide = 128;  ///< cells along x and y
  static constexpr std::size_t kWords = kSide * kSide / 64;
  std::array<std::uint64_t, kWords> bits{};  ///< bit x of row y: bit (y * 128 + x); row 64, bit 64 begins at the sensor
  std::size_t count = 0;                     ///< of bits that are set
};

/// The image, in cells of `cell_m`, of a cloud that was set upright (ThinCloud::up), turned by `yaw_rad`
/// (counter-clockwise seen from above).
OverheadImage overhead_image(const ThinCloud& cloud, double cell_m, double yaw_rad = 0.0);

struct OverheadMatch {
  double yaw_rad = 0.0;         ///< heading of the query in the match's frame, both upright
  double x_m = 0.0, y_m = 0.0;  ///< position of the query in the match's upright frame, whole cells
  double overlap = 0.0;  ///< share of each image that lies on or beside the other's, the smaller of both, [0, 1]; of
                         ///< sensors that do not see all round, of what lies in the other's sector
};

/// A query scan laid on places from above, to find where it stands before registration: headings in steps of 3 degrees
/// and positions in steps of a cell, every other one tried first; cells are the larger voxels of both scans. Images of
/// its turns are kept from place to place. Belongs to one thread at a time; headings are tried in parallel.
class OverheadSearch {
 public:
  explicit OverheadSearch(const ThinCloud& query);

  /// Of all headings within `yaw_reach_rad` of `yaw_rad`, at positions up to `reach_m` (less than 63 cells) along x and
  /// y: the pose at which the scans share most cells, and the next best ones that lie more than 3 cells or 12 degrees
  /// from it, at most `wanted`; at least one. A `yaw_reach_rad` of pi is every heading.
  std::vector<OverheadMatch> search(const ThinCloud& match, double yaw_rad, double yaw_reach_rad, double reach_m,
                                    std::size_t wanted = 1);

 private:
  struct Turned {
    std::optional<OverheadImage> image;
    std::map<int, OverheadImage> moved_along_x;  ///< by cells
  };
  struct At {
    int step, x, y;  ///< heading in steps, position in cells
    std::uint32_t shared;
  };
  void try_headings(const OverheadImage& place_grown, int first_step, int last_step, int reach_cells);
  Turned& turned(int step);
  const OverheadImage& moved(int step, int x);
  OverheadMatch match_at(const OverheadImage& place, const OverheadImage& place_grown, const At& at);
  At climb(const OverheadImage& place_grown, const At& at);
  static bool is_beside(const At& a, const At& b);

  const ThinCloud& query_;
  SeenSpace::Sector query_sector_, place_sector_;
  OverheadImage seen_by_place_;  ///< where the place's sensor looks, if not all round
  double cell_m_ = 0.0;
  std::vector<Turned> turns_;  ///< by steps of the heading, in cells of cell_m_; made when asked for
  std::vector<At> coarse_;     ///< of the search at work
};

}  // namespace revisit
