// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include <pcl/features/fpfh.h>
#include <pcl/point_types.h>
#include <pcl/search/kdtree.h>

#include <revisit/registration/feature_alignment.hpp>

namespace revisit {

Features compute_features(const SurfaceCloud& cloud, double radius_m) {
  pcl::PointCloud<pcl::PointXYZ>::Ptr points(new pcl::PointCloud<pcl::PointXYZ>);
  pcl::PointCloud<pcl::Normal>::Ptr normals(new pcl::PointCloud<pcl::Normal>);
  Features features;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    if (cloud.is_ground(i) || cloud.normal(i).squaredNorm() < 0.5f) continue;
    const Eigen::Vector3f& p = cloud.point(i);
    // The feature needs consistent signs: normals look at the sensor.
    const Eigen::Vector3f n = cloud.normal(i).dot(p) > 0.f ? Eigen::Vector3f(-cloud.normal(i)) : cloud.normal(i);
    points->emplace_back(p.x(), p.y(), p.z());
    normals->emplace_back(n.x(), n.y(), n.z());
    features.points.push_back(i);
  }
  features.values.resize(33, static_cast<Eigen::Index>(points->size()));
  if (points->empty()) return features;
  pcl::FPFHEstimation<pcl::PointXYZ, pcl::Normal, pcl::FPFHSignature33> estimation;
  estimation.setInputCloud(points);
  estimation.setInputNormals(normals);
  estimation.setSearchMethod(pcl::search::KdTree<pcl::PointXYZ>::Ptr(new pcl::search::KdTree<pcl::PointXYZ>));
  estimation.setRadiusSearch(radius_m);
  pcl::PointCloud<pcl::FPFHSignature33> signatures;
  estimation.compute(signatures);
  std::vector<std::size_t> kept;
  for (std::size_t i = 0; i < signatures.size(); ++i) {
    const Eigen::Map<const Eigen::Matrix<float, 33, 1>> signature(signatures[i].histogram);
    if (!signature.allFinite()) continue;
    features.values.col(static_cast<Eigen::Index>(kept.size())) = signature;
    kept.push_back(features.points[i]);
  }
  features.points = std::move(kept);
  features.values.conservativeResize(33, static_cast<Eigen::Index>(features.points.size()));
  return features;
}

}  // namespace revisit
