// SPDX-License-Identifier: Apache-2.0
#include "oracles/pcl_icp.hpp"

#include <pcl/point_types.h>
#include <pcl/registration/gicp.h>
#include <pcl/registration/icp.h>

namespace revisit::oracles {
namespace {

pcl::PointCloud<pcl::PointNormal>::Ptr with_normals(const SurfaceCloud& from) {
  pcl::PointCloud<pcl::PointNormal>::Ptr to(new pcl::PointCloud<pcl::PointNormal>);
  for (std::size_t i = 0; i < from.size(); ++i) {
    if (from.normal(i).squaredNorm() < 0.5f) continue;
    pcl::PointNormal p;
    p.getVector3fMap() = from.point(i);
    p.getNormalVector3fMap() = from.normal(i);
    to->push_back(p);
  }
  return to;
}

pcl::PointCloud<pcl::PointXYZ>::Ptr without_normals(const SurfaceCloud& from) {
  pcl::PointCloud<pcl::PointXYZ>::Ptr to(new pcl::PointCloud<pcl::PointXYZ>);
  for (const auto& p : from.points()) to->push_back({p.x(), p.y(), p.z()});
  return to;
}

}  // namespace

Pose pcl_point_to_plane(const SurfaceCloud& target, const SurfaceCloud& source, const Pose& T_guess, double reach_m,
                        int most_iterations) {
  pcl::IterativeClosestPointWithNormals<pcl::PointNormal, pcl::PointNormal> icp;
  icp.setInputTarget(with_normals(target));
  icp.setInputSource(with_normals(source));
  icp.setMaxCorrespondenceDistance(reach_m);
  icp.setMaximumIterations(most_iterations);
  pcl::PointCloud<pcl::PointNormal> unused;
  icp.align(unused, T_guess.matrix().cast<float>());
  return Pose(icp.getFinalTransformation().cast<double>());
}

Pose pcl_generalised_icp(const SurfaceCloud& target, const SurfaceCloud& source, double reach_m) {
  pcl::GeneralizedIterativeClosestPoint<pcl::PointXYZ, pcl::PointXYZ> icp;
  icp.setInputTarget(without_normals(target));
  icp.setInputSource(without_normals(source));
  icp.setMaxCorrespondenceDistance(reach_m);
  pcl::PointCloud<pcl::PointXYZ> unused;
  icp.align(unused);
  return Pose(icp.getFinalTransformation().cast<double>());
}

}  // namespace revisit::oracles
