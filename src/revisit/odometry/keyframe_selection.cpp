// SPDX-License-Identifier: Apache-2.0
#include <revisit/odometry/keyframe_selection.hpp>

#include <algorithm>
#include <utility>

namespace revisit {
namespace {

// Round a corner, or through a door: what is visible now was hidden from the last key frame (docs/slam.md).
struct View {
  static constexpr double kLeastShared = 0.5;    ///< share of the points that was visible from there
  static constexpr std::size_t kSamples = 2000;  ///< points looked at
  static constexpr float kMargin_m = 1.f;        ///< what ranges within a cell of seen space may be off
};

}  // namespace

bool KeyframeSelection::is_keyframe(const Pose& T_odom_lidar, std::span<const Point> points) const {
  const Pose T_last_lidar = T_odom_last_.inverse() * T_odom_lidar;
  if (T_last_lidar.translation().norm() >= options_.keyframe_distance_m ||
      to_degrees(rotation_angle(T_last_lidar)) >= options_.keyframe_angle_deg)
    return true;
  const Eigen::Isometry3f T = T_last_lidar.cast<float>();
  const std::size_t stride = std::max<std::size_t>(1, points.size() / View::kSamples);
  std::size_t samples = 0, shared = 0;
  for (std::size_t i = 0; i < points.size(); i += stride) {
    const Point& p = points[i];
    ++samples;
    shared += seen_from_last_.look(T * Eigen::Vector3f(p.x, p.y, p.z), View::kMargin_m) == SeenSpace::Verdict::kSurface;
  }
  return static_cast<double>(shared) < View::kLeastShared * static_cast<double>(samples);
}

void KeyframeSelection::set_last(const Pose& T_odom_lidar, SeenSpace seen) {
  T_odom_last_ = T_odom_lidar;
  seen_from_last_ = std::move(seen);
}

}  // namespace revisit
