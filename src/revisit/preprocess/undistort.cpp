// SPDX-License-Identifier: Apache-2.0
#include <revisit/preprocess/undistort.hpp>

#include <algorithm>
#include <cmath>
#include <vector>

#include <revisit/core/pose.hpp>

namespace revisit {

namespace {

// Writes each point as it would have been seen at the stamp; false where the times do not allow it.
bool compensate(const Scan& scan, const Twist& motion, Point* result) {
  if (scan.times_s.size() != scan.points.size() || scan.points.empty()) return false;
  const auto [first, last] = std::minmax_element(scan.times_s.begin(), scan.times_s.end());
  if (!std::isfinite(*first) || !std::isfinite(*last) || *last - *first > 1.f)
    return false;  // no sweep lasts that long
  // Poses at a thousand moments of the sweep: a car moves 3 mm from one to the next.
  constexpr int kMoments = 1000;
  const float step_s = std::max(1e-9f, (*last - *first) / kMoments);
  std::vector<Eigen::Isometry3f> T_stamp_moment(kMoments + 1);
  for (int i = 0; i <= kMoments; ++i)
    T_stamp_moment[static_cast<std::size_t>(i)] =
        motion_after(motion, static_cast<double>(*first + (static_cast<float>(i) + 0.5f) * step_s)).cast<float>();
  for (std::size_t i = 0; i < scan.points.size(); ++i) {
    const Point p = scan.points[i];
    result[i] = p;
    const float steps = (scan.times_s[i] - *first) / step_s;
    if (!std::isfinite(steps)) continue;  // a point without a time stays where it is
    const auto moment = static_cast<std::size_t>(std::max(0.f, steps));
    const Eigen::Vector3f q = T_stamp_moment[std::min<std::size_t>(moment, kMoments)] * Eigen::Vector3f(p.x, p.y, p.z);
    result[i] = {q.x(), q.y(), q.z(), p.intensity};
  }
  return true;
}

}  // namespace

void undistort(Scan& scan, const Twist& motion) { compensate(scan, motion, scan.points.data()); }

std::vector<Point> compensated(const Scan& scan, const Twist& motion) {
  std::vector<Point> points(scan.points.size());
  if (!compensate(scan, motion, points.data())) points = scan.points;
  return points;
}

void assume_sweep(Scan& scan, double sweep_s) {
  if (!scan.times_s.empty() || sweep_s == 0.0) return;
  const auto per_rad_s = static_cast<float>(-sweep_s / (2.0 * kPi));
  scan.times_s.reserve(scan.points.size());
  for (const Point& p : scan.points) scan.times_s.push_back(per_rad_s * std::atan2(p.y, p.x));
}

}  // namespace revisit
