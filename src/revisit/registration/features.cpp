// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <vector>

#include <Eigen/Geometry>

#include <revisit/core/pose.hpp>
#include <revisit/registration/feature_alignment.hpp>
#include <revisit/registration/internal/column_grid.hpp>

namespace revisit {
namespace {

using registration_internal::ColumnGrid;

constexpr int kBins = 11, kAngles = 3, kNumbers = kBins * kAngles;  // as in the paper: 33
using Histogram = Eigen::Matrix<float, kNumbers, 1>;

struct Oriented {
  Eigen::Vector3f point, normal;
};

// The three angles between two oriented points, each in [0, 1) of its range (Rusu et al., ICRA 2009, section III).
// Nothing where the two are one, or the frame between them is not defined.
std::optional<std::array<float, kAngles>> angles_between(const Oriented& a, const Oriented& b) {
  Eigen::Vector3f d = b.point - a.point;
  const float distance = d.norm();
  if (!(distance > 0.f)) return std::nullopt;
  d /= distance;
  // The source is the one whose normal makes the smaller angle with the line between them.
  const bool a_is_source = std::abs(a.normal.dot(d)) >= std::abs(b.normal.dot(d));
  const Eigen::Vector3f u = a_is_source ? a.normal : b.normal, n = a_is_source ? b.normal : a.normal;
  if (!a_is_source) d = -d;
  Eigen::Vector3f v = d.cross(u);
  const float length = v.norm();
  if (!(length > 1e-6f)) return std::nullopt;
  v /= length;
  const Eigen::Vector3f w = u.cross(v);
  const auto turn = static_cast<float>((std::atan2(w.dot(n), u.dot(n)) + kPi) / (2.0 * kPi));
  return std::array<float, kAngles>{turn, 0.5f * (v.dot(n) + 1.f), 0.5f * (u.dot(d) + 1.f)};
}

int bin_of(float share) { return std::clamp(static_cast<int>(share * kBins), 0, kBins - 1); }

// The simplified histogram of a point: of the angles to each of its neighbours, in percent.
Histogram simplified(const std::vector<Oriented>& points, const ColumnGrid& grid, std::size_t i, float radius_m) {
  Histogram histogram = Histogram::Zero();
  float pairs = 0.f;
  grid.for_each_within(points[i].point, radius_m, [&](std::size_t j, float) {
    const auto angles = j == i ? std::nullopt : angles_between(points[i], points[j]);
    if (!angles) return;
    for (int k = 0; k < kAngles; ++k) histogram[k * kBins + bin_of((*angles)[static_cast<std::size_t>(k)])] += 1.f;
    pairs += 1.f;
  });
  return pairs > 0.f ? Histogram(histogram * (100.f / pairs)) : histogram;
}

}  // namespace

Features compute_features(const SurfaceCloud& cloud, double radius_m) {
  Features features;
  std::vector<Oriented> points;
  std::vector<Eigen::Vector3f> positions;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    if (cloud.is_ground(i) || cloud.normal(i).squaredNorm() < 0.5f) continue;
    const Eigen::Vector3f& p = cloud.point(i);
    // The feature needs consistent signs: normals look at the sensor.
    const Eigen::Vector3f n = cloud.normal(i).dot(p) > 0.f ? Eigen::Vector3f(-cloud.normal(i)) : cloud.normal(i);
    points.push_back({p, n});
    positions.push_back(p);
    features.points.push_back(i);
  }
  const auto radius = static_cast<float>(radius_m);
  const ColumnGrid grid(positions, std::max(0.1f, 0.5f * radius));
  std::vector<Histogram> histograms;
  histograms.reserve(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) histograms.push_back(simplified(points, grid, i, radius));

  features.values.resize(kNumbers, static_cast<Eigen::Index>(points.size()));
  for (std::size_t i = 0; i < points.size(); ++i) {
    // Its own, and those of its neighbours by their nearness; each angle in percent again.
    Histogram sum = Histogram::Zero();
    float neighbours = 0.f;
    grid.for_each_within(points[i].point, radius, [&](std::size_t j, float squared_m2) {
      if (j == i || !(squared_m2 > 0.f)) return;
      sum += histograms[j] / squared_m2;
      neighbours += 1.f;
    });
    if (neighbours > 0.f) sum = histograms[i] + sum / neighbours;
    for (int k = 0; k < kAngles; ++k) {
      auto angle = sum.segment<kBins>(Eigen::Index{k} * kBins);
      if (const float all = angle.sum(); all > 0.f) angle *= 100.f / all;
    }
    features.values.col(static_cast<Eigen::Index>(i)) = sum;
  }
  return features;
}

}  // namespace revisit
