// SPDX-License-Identifier: Apache-2.0
#include <revisit/simulation/internal/path.hpp>

#include <algorithm>
#include <cmath>

#include <revisit/core/pose.hpp>

namespace revisit::simulation_internal {

Path::Path(std::vector<Knot> knots) : knots_(std::move(knots)), arc_m_(knots_.size(), 0.0) {
  for (std::size_t i = 1; i < knots_.size(); ++i)
    arc_m_[i] = arc_m_[i - 1] + std::hypot(knots_[i].x - knots_[i - 1].x, knots_[i].y - knots_[i - 1].y);
}

Path Path::moved(const Eigen::Vector3d& by) const {
  std::vector<Knot> knots = knots_;
  for (Knot& knot : knots) {
    knot.x += by.x();
    knot.y += by.y();
    knot.ground_z += by.z();
  }
  return Path(std::move(knots));
}

Path Path::part(double from_m, double to_m, double left_m, bool reverse) const {
  std::vector<Knot> knots;
  for (std::size_t i = 0; i < knots_.size(); ++i) {
    if (arc_m_[i] < from_m || arc_m_[i] > to_m) continue;
    Knot knot = knots_[i];
    knot.x -= left_m * std::sin(knot.yaw_rad);
    knot.y += left_m * std::cos(knot.yaw_rad);
    if (reverse) knot.yaw_rad = wrap_angle(knot.yaw_rad + kPi);
    knots.push_back(knot);
  }
  if (reverse) std::reverse(knots.begin(), knots.end());
  return knots.size() < 2 ? Path() : Path(std::move(knots));
}

Knot Path::at(double time_s) const {
  const double last = static_cast<double>(knots_.size() - 1);
  const double position = time_s / kStep_s, from = std::clamp(std::floor(position), 0.0, last - 1.0);
  const auto i = static_cast<std::size_t>(from);
  const double t = position - from;
  const Knot &a = knots_[i], &b = knots_[i + 1];
  Knot result;
  if (t < 0.0 || t > 1.0) {
    result.x = a.x + t * (b.x - a.x);
    result.y = a.y + t * (b.y - a.y);
  } else {  // Catmull-Rom
    const Knot before = i > 0 ? knots_[i - 1] : Knot{2 * a.x - b.x, 2 * a.y - b.y, 0, 0};
    const Knot after = i + 2 < knots_.size() ? knots_[i + 2] : Knot{2 * b.x - a.x, 2 * b.y - a.y, 0, 0};
    const auto curve = [t](double p0, double p1, double p2, double p3) {
      return p1 + 0.5 * t * (p2 - p0 + t * (2 * p0 - 5 * p1 + 4 * p2 - p3 + t * (3 * (p1 - p2) + p3 - p0)));
    };
    result.x = curve(before.x, a.x, b.x, after.x);
    result.y = curve(before.y, a.y, b.y, after.y);
  }
  result.yaw_rad = wrap_angle(a.yaw_rad + t * wrap_angle(b.yaw_rad - a.yaw_rad));
  result.ground_z = a.ground_z + t * (b.ground_z - a.ground_z);
  return result;
}

double Path::arc_at(double time_s) const {
  const double position = std::clamp(time_s / kStep_s, 0.0, static_cast<double>(knots_.size() - 1));
  const auto i = std::min(static_cast<std::size_t>(position), knots_.size() - 2);
  return arc_m_[i] + (position - static_cast<double>(i)) * (arc_m_[i + 1] - arc_m_[i]);
}

Knot Path::beside(double arc_m, double left_m) const {
  const auto upper = std::upper_bound(arc_m_.begin() + 1, arc_m_.end() - 1, arc_m);
  const auto i = static_cast<std::size_t>(upper - arc_m_.begin()) - 1;
  const Knot &a = knots_[i], &b = knots_[i + 1];
  const double span = std::max(arc_m_[i + 1] - arc_m_[i], 1e-9), t = std::clamp((arc_m - arc_m_[i]) / span, 0.0, 1.0);
  Knot result;
  result.yaw_rad = wrap_angle(a.yaw_rad + t * wrap_angle(b.yaw_rad - a.yaw_rad));
  result.x = a.x + t * (b.x - a.x) - left_m * std::sin(result.yaw_rad);
  result.y = a.y + t * (b.y - a.y) + left_m * std::cos(result.yaw_rad);
  result.ground_z = a.ground_z + t * (b.ground_z - a.ground_z);
  return result;
}

namespace {

// The way with each corner replaced by an arc, a point each ~0.1 m, and how fast each may be passed.
struct Way {
  std::vector<Eigen::Vector2d> points;
  std::vector<double> speed_mps;
};

Way round_corners(const std::vector<Eigen::Vector2d>& corners, const Driving& driving) {
  Way way;
  const auto straight_to = [&](const Eigen::Vector2d& end, double speed) {
    if (way.points.empty()) {
      way.points.push_back(end);
      way.speed_mps.push_back(speed);
      return;
    }
    const Eigen::Vector2d start = way.points.back();
    const int steps = std::max(1, static_cast<int>((end - start).norm() / 0.1));
    for (int i = 1; i <= steps; ++i) {
      way.points.push_back(start + (end - start) * (static_cast<double>(i) / steps));
      way.speed_mps.push_back(speed);
    }
  };
  straight_to(corners.front(), driving.speed_mps);
  for (std::size_t i = 1; i + 1 < corners.size(); ++i) {
    const Eigen::Vector2d in = (corners[i] - corners[i - 1]).normalized();
    const Eigen::Vector2d out = (corners[i + 1] - corners[i]).normalized();
    const double turn = std::atan2(in.x() * out.y() - in.y() * out.x(), in.dot(out));
    const double half_tangent = std::tan(std::abs(turn) / 2.0);
    const double room = 0.45 * std::min((corners[i] - corners[i - 1]).norm(), (corners[i + 1] - corners[i]).norm());
    const double cut = std::min(driving.corner_radius_m * half_tangent, room);
    if (std::abs(turn) < 0.02) {
      straight_to(corners[i], driving.speed_mps);
      continue;
    }
    const double radius = cut / half_tangent;
    const double speed =
        std::min(driving.speed_mps, driving.corner_speed_mps * std::sqrt(radius / driving.corner_radius_m) /
                                        std::sqrt(std::max(0.3, std::abs(turn) / (kPi / 2))));
    straight_to(corners[i] - cut * in, driving.speed_mps);
    const Eigen::Vector2d start = way.points.back(), left(-in.y(), in.x());
    const double side = turn > 0 ? 1.0 : -1.0;
    const int steps = std::max(2, static_cast<int>(radius * std::abs(turn) / 0.1));
    for (int k = 1; k <= steps; ++k) {
      const double angle = std::abs(turn) * k / steps;
      way.points.push_back(start + radius * (std::sin(angle) * in + side * (1.0 - std::cos(angle)) * left));
      way.speed_mps.push_back(speed);
    }
  }
  straight_to(corners.back(), driving.speed_mps);
  return way;
}

}  // namespace

std::vector<Knot> drive(const std::vector<Eigen::Vector2d>& corners, const Driving& driving) {
  Way way = round_corners(corners, driving);
  const std::size_t n = way.points.size();
  const auto gap = [&](std::size_t i) { return (way.points[i] - way.points[i - 1]).norm(); };
  // It starts and ends at a walking pace, and nowhere accelerates or brakes harder than allowed.
  way.speed_mps.front() = way.speed_mps.back() = 0.2 * driving.speed_mps;
  const auto reachable = [&](double speed, double metres) {
    return std::sqrt(speed * speed + 2.0 * driving.acceleration_mps2 * metres);
  };
  for (std::size_t i = 1; i < n; ++i)
    way.speed_mps[i] = std::min(way.speed_mps[i], reachable(way.speed_mps[i - 1], gap(i)));
  for (std::size_t i = n - 1; i > 0; --i)
    way.speed_mps[i - 1] = std::min(way.speed_mps[i - 1], reachable(way.speed_mps[i], gap(i)));

  std::vector<Knot> knots;
  double time_s = 0.0;
  for (std::size_t i = 0; i + 1 < n; ++i) {
    const Eigen::Vector2d step = way.points[i + 1] - way.points[i];
    const double duration_s = 2.0 * step.norm() / (way.speed_mps[i] + way.speed_mps[i + 1]);
    for (double next = Path::kStep_s * static_cast<double>(knots.size()); next < time_s + duration_s;
         next = Path::kStep_s * static_cast<double>(knots.size())) {
      const Eigen::Vector2d p = way.points[i] + step * std::max(0.0, (next - time_s) / duration_s);
      knots.push_back({p.x(), p.y(), std::atan2(step.y(), step.x()), 0.0});
    }
    time_s += duration_s;
  }
  return knots;
}

}  // namespace revisit::simulation_internal
