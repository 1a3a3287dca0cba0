// SPDX-License-Identifier: Apache-2.0
#include <revisit/preprocess/upright.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <random>
#include <vector>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

namespace revisit {
namespace {

// Chosen on a VLP-16 carried by hand, seeds 51 and 54 (docs/history.md).
struct Upright {
  static constexpr float kNear_m = 1.5f, kFar_m = 20.f;  ///< the ground around the sensor
  static constexpr std::size_t kSample = 1000, kFewest = 100;
  static constexpr int kTrials = 100;
  static constexpr float kThickness_m = 0.15f;  ///< roughness of the ground, to either side
  static constexpr double kMostTilt_deg = 40.0;
  static constexpr double kLevel_deg = 8.0;  ///< below, as on a car, nothing is changed
  // A plane is the ground where much of what is around lies on it, next to nothing below, and spread over an area.
  static constexpr float kLeastShare = 0.15f, kMostBelow = 0.05f, kBelow_m = 0.4f, kLeastSpread_m = 1.f;
};

struct Plane {
  Eigen::Vector3f normal = Eigen::Vector3f::UnitZ();  ///< points up
  float offset_m = 0.f;                               ///< of the sensor above it
  float height_m(const Eigen::Vector3f& p) const { return normal.dot(p) + offset_m; }
};

std::vector<Eigen::Vector3f> sample_around(std::span<const Point> points) {
  const auto is_around = [](const Point& p) {
    const float squared = p.x * p.x + p.y * p.y + p.z * p.z;
    return squared >= Upright::kNear_m * Upright::kNear_m && squared <= Upright::kFar_m * Upright::kFar_m;
  };
  const auto count = static_cast<std::size_t>(std::count_if(points.begin(), points.end(), is_around));
  const std::size_t stride = count / Upright::kSample + 1;
  std::vector<Eigen::Vector3f> sample;
  sample.reserve(count / stride + 1);
  std::size_t i = 0;
  for (const Point& p : points)
    if (is_around(p) && i++ % stride == 0) sample.emplace_back(p.x, p.y, p.z);
  return sample;
}

std::vector<Eigen::Vector3f> on_plane(const Plane& plane, const std::vector<Eigen::Vector3f>& points) {
  std::vector<Eigen::Vector3f> on_it;
  for (const Eigen::Vector3f& p : points)
    if (std::abs(plane.height_m(p)) <= Upright::kThickness_m) on_it.push_back(p);
  return on_it;
}

// The plane through these points, no more than the largest tilt from level.
std::optional<Plane> through(const Eigen::Vector3f& point, Eigen::Vector3f normal) {
  const float length = normal.norm();
  if (!(length > 1e-6f)) return std::nullopt;
  normal /= normal.z() < 0.f ? -length : length;
  if (normal.z() < static_cast<float>(std::cos(to_radians(Upright::kMostTilt_deg)))) return std::nullopt;
  return Plane{normal, -normal.dot(point)};
}

// The plane that most points lie on, by RANSAC (Fischler and Bolles, 1981), with a fixed seed: deterministic.
std::optional<Plane> fullest_plane(const std::vector<Eigen::Vector3f>& points) {
  std::minstd_rand random(1);
  std::optional<Plane> best;
  std::size_t most = 0;
  for (int trial = 0; trial < Upright::kTrials; ++trial) {
    std::array<Eigen::Vector3f, 3> p;
    for (Eigen::Vector3f& each : p) each = points[random() % points.size()];
    const auto plane = through(p[0], (p[1] - p[0]).cross(p[2] - p[0]));
    if (!plane) continue;
    const auto count = static_cast<std::size_t>(std::count_if(points.begin(), points.end(), [&](const auto& q) {
      return std::abs(plane->height_m(q)) <= Upright::kThickness_m;
    }));
    if (count <= most) continue;
    most = count;
    best = plane;
  }
  return best;
}

struct Spread {
  Eigen::Vector3f mean, variances;  ///< increasing
  Eigen::Matrix3f axes;
};

Spread spread_of(const std::vector<Eigen::Vector3f>& points) {
  Eigen::Vector3f mean = Eigen::Vector3f::Zero();
  for (const Eigen::Vector3f& p : points) mean += p;
  mean /= static_cast<float>(points.size());
  Eigen::Matrix3f covariance = Eigen::Matrix3f::Zero();
  for (const Eigen::Vector3f& p : points) covariance += (p - mean) * (p - mean).transpose();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3f> solver(covariance / static_cast<float>(points.size()));
  return {mean, solver.eigenvalues(), solver.eigenvectors()};
}

}  // namespace

Eigen::Vector3f find_up(std::span<const Point> points) {
  const Eigen::Vector3f straight = Eigen::Vector3f::UnitZ();
  const std::vector<Eigen::Vector3f> around = sample_around(points);
  if (around.size() < Upright::kFewest) return straight;
  const auto found = fullest_plane(around);
  if (!found) return straight;
  const std::vector<Eigen::Vector3f> on_it = on_plane(*found, around);
  const Spread spread = spread_of(on_it);
  const auto plane = through(spread.mean, spread.axes.col(0));
  if (!plane || plane->normal.z() >= static_cast<float>(std::cos(to_radians(Upright::kLevel_deg)))) return straight;

  const auto all = static_cast<float>(around.size());
  const auto below = static_cast<float>(std::count_if(
      around.begin(), around.end(), [&](const auto& p) { return plane->height_m(p) < -Upright::kBelow_m; }));
  const bool is_ground =
      plane->offset_m >= Upright::kThickness_m && static_cast<float>(on_it.size()) >= Upright::kLeastShare * all &&
      below <= Upright::kMostBelow * all && spread.variances[1] >= Upright::kLeastSpread_m * Upright::kLeastSpread_m;
  return is_ground ? plane->normal : straight;
}

Eigen::Vector3f unless_level(const Eigen::Vector3f& up) {
  return up.z() >= static_cast<float>(std::cos(to_radians(Upright::kLevel_deg))) ? Eigen::Vector3f::UnitZ().eval() : up;
}

void rotate(std::span<Point> points, const Pose& T_new_old) {
  const Eigen::Matrix3f R = T_new_old.linear().cast<float>();
  if (R.isIdentity(0.f)) return;
  for (Point& p : points) {
    const Eigen::Vector3f q = R * Eigen::Vector3f(p.x, p.y, p.z);
    p = {q.x(), q.y(), q.z(), p.intensity};
  }
}

}  // namespace revisit
