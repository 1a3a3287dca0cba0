// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <vector>

#include <revisit/core/pose.hpp>
#include <revisit/registration/surface_cloud.hpp>

namespace revisit {

/// What stands above the ground, seen from overhead: one bit a square metre, 128 m wide, the sensor in the middle.
struct OverheadImage {
  static constexpr int kSide = 128;  ///< cells along x and y
  static constexpr double kCell_m = 1.0;
  static constexpr std::size_t kWords = kSide * kSide / 64;
  std::array<std::uint64_t, kWords> bits{};  ///< bit x of row y: bit (y * 128 + x); row 64, bit 64 begins at the sensor
  std::size_t count = 0;                     ///< of bits that are set
};

/// The image of a cloud that was set upright (ThinCloud::up), turned by `yaw_rad` (counter-clockwise seen from above).
OverheadImage overhead_image(const ThinCloud& cloud, double yaw_rad = 0.0);

struct OverheadMatch {
  double yaw_rad = 0.0;         ///< heading of the query in the match's frame, both upright
  double x_m = 0.0, y_m = 0.0;  ///< position of the query in the match's upright frame, whole metres
  double overlap = 0.0;         ///< share of each image that lies on or beside the other's, the smaller of both, [0, 1]
};

/// A query scan laid on places from above, to find where it stands before registration: headings in steps of 3 degrees
/// and positions in steps of 1 m, all tried. Images of its turns are kept from
/// place to place: one object for each thread.
class OverheadSearch {
 public:
  explicit OverheadSearch(const ThinCloud& query) : query_(query) {}

  /// The best of all headings within `yaw_reach_rad` of `yaw_rad`, at positions up to `reach_m` (less than 64) along x
  /// and y.
  OverheadMatch search(const ThinCloud& match, double yaw_rad, double yaw_reach_rad, int reach_m);

 private:
  struct Turned {
    OverheadImage image;
    std::vector<OverheadImage> moved_along_x;  ///< by -reach_m ... reach_m
  };
  const Turned& turned(int step, int reach_m);

  const ThinCloud& query_;
  std::map<int, Turned> turns_;
};

}  // namespace revisit
