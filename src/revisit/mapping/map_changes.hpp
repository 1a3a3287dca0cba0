// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <span>
#include <vector>

#include <revisit/core/point_history.hpp>
#include <revisit/core/pose.hpp>
#include <revisit/core/scan.hpp>

namespace revisit {

namespace mapping_internal {
class VisibilityImage;
}

/// The points of a place, in its frame, with the history of each.
struct PlacePoints {
  Pose T_map_lidar = Pose::Identity();
  std::vector<Point> points;
  std::vector<PointHistory> history;
};

/// What a session saw from a key frame, in its frame, to be compared with several places. It does not change: threads
/// may share it.
class SeenFromKeyframe {
 public:
  explicit SeenFromKeyframe(std::vector<Point> points);
  ~SeenFromKeyframe();
  const std::vector<Point>& points() const { return points_; }
  const mapping_internal::VisibilityImage& image() const { return *image_; }

 private:
  std::vector<Point> points_;
  std::unique_ptr<const mapping_internal::VisibilityImage> image_;
};

struct Visit {
  Pose T_map_lidar = Pose::Identity();
  std::shared_ptr<const SeenFromKeyframe> seen;
};

/// Visits after which what they saw through is no longer part of the map.
constexpr int kVisitsUntilGone = 3;

/// Compares a place with what the visits of one session nearby saw: points they saw through are missed once more, or
/// gone; points they saw are not. What stands where the place saw through, as two visits agree, is added to it. True
/// where anything changed.
bool update_place(PlacePoints& place, std::span<const Visit> visits, int session);

}  // namespace revisit
