// SPDX-License-Identifier: Apache-2.0
#include <revisit/preprocess/upright.hpp>

#include <algorithm>
#include <cmath>

#include <pcl/common/centroid.h>
#include <pcl/console/print.h>
#include <pcl/sample_consensus/ransac.h>
#include <pcl/sample_consensus/sac_model_perpendicular_plane.h>
#include <Eigen/Eigenvalues>

#include <revisit/core/pose.hpp>

namespace revisit {
namespace {

using Cloud = pcl::PointCloud<pcl::PointXYZ>;

constexpr float kThickness_m = 0.15f;  // roughness of the ground, to either side

// Some 1,000 of the points around.
Cloud::Ptr sample_around(std::span<const Point> points) {
  constexpr float kNear_m = 1.5f, kFar_m = 20.f;
  constexpr std::size_t kSample = 1000;
  const auto is_around = [](const Point& p) {
    const float squared = p.x * p.x + p.y * p.y + p.z * p.z;
    return squared >= kNear_m * kNear_m && squared <= kFar_m * kFar_m;
  };
  const auto count = static_cast<std::size_t>(std::count_if(points.begin(), points.end(), is_around));
  const std::size_t stride = count / kSample + 1;
  const auto sample = pcl::make_shared<Cloud>();
  sample->reserve(count / stride + 1);
  std::size_t i = 0;
  for (const Point& p : points)
    if (is_around(p) && i++ % stride == 0) sample->emplace_back(p.x, p.y, p.z);
  return sample;
}

// Whether a plane n p + d = 0 with these points on it is the ground: much of what is around lies on it, spread over an
// area, next to nothing below, and the sensor stands above.
bool is_ground(const Eigen::Vector3f& n, float d, const Cloud& around, const pcl::Indices& on_it) {
  constexpr float kLeastShare = 0.15f, kMostBelow = 0.05f, kBelow_m = 0.4f, kLeastSpread_m = 1.f;
  const auto below = static_cast<float>(std::count_if(
      around.begin(), around.end(), [&](const auto& p) { return n.dot(p.getVector3fMap()) + d < -kBelow_m; }));
  const auto all = static_cast<float>(around.size());
  if (d < kThickness_m || static_cast<float>(on_it.size()) < kLeastShare * all || below > kMostBelow * all)
    return false;
  Eigen::Matrix3f covariance;
  Eigen::Vector4f middle;
  pcl::computeMeanAndCovarianceMatrix(around, on_it, covariance, middle);
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3f> axes(covariance, Eigen::EigenvaluesOnly);
  return axes.eigenvalues()[1] >= kLeastSpread_m * kLeastSpread_m;
}

}  // namespace

Eigen::Vector3f find_up(std::span<const Point> points) {
  constexpr std::size_t kFewest = 100;
  constexpr double kMostTilt_deg = 40.0, kLevel_deg = 8.0;
  constexpr int kPlanes = 100;
  const Eigen::Vector3f straight = Eigen::Vector3f::UnitZ();
  const Cloud::Ptr around = sample_around(points);
  if (around->size() < kFewest) return straight;

  // The library never prints; PCL would, where no plane is found.
  [[maybe_unused]] static const bool is_silent = (pcl::console::setVerbosityLevel(pcl::console::L_ALWAYS), true);
  const auto model = pcl::make_shared<pcl::SampleConsensusModelPerpendicularPlane<pcl::PointXYZ>>(around);
  model->setAxis(straight);
  model->setEpsAngle(to_radians(kMostTilt_deg));
  pcl::RandomSampleConsensus<pcl::PointXYZ> search(model, kThickness_m);
  search.setMaxIterations(kPlanes);
  if (!search.computeModel()) return straight;
  pcl::Indices on_it;
  search.getInliers(on_it);
  Eigen::VectorXf found, plane;
  search.getModelCoefficients(found);
  model->optimizeModelCoefficients(on_it, found, plane);
  if (plane[2] < 0.f) plane = -plane;
  const Eigen::Vector3f up = plane.head<3>();
  const bool is_level = up.z() >= std::cos(to_radians(kLevel_deg));
  return !is_level && is_ground(up, plane[3], *around, on_it) ? up : straight;
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
