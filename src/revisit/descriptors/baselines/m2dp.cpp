// SPDX-License-Identifier: Apache-2.0
// He, Wang and Zhang, "M2DP: A Novel 3D Point Cloud Descriptor and Its Application in Loop Closure Detection",
// IROS 2016: the cloud, centred and turned to its principal axes, is projected onto 64 planes; on each, the points are
// counted in 8 circles x 16 sectors; the first left and right singular vectors of the 64 x 128 counts are the
// descriptor. Euclidean distance. Principal axes have no sign that the scan decides, so a scan seen from the other side
// may differ. At most 16,384 points are taken, evenly through the scan.
#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/Eigenvalues>

#include <revisit/core/pose.hpp>
#include <revisit/descriptors/internal/baselines.hpp>

namespace revisit::descriptors_internal {
namespace m2dp {
namespace {

constexpr int kCircles = 8, kSectors = 16, kAzimuths = 4, kElevations = 16;
constexpr Eigen::Index kPlanes = Eigen::Index{kAzimuths} * kElevations, kBins = Eigen::Index{kCircles} * kSectors;
constexpr std::size_t kMostPoints = 16384;

// The scan in the frame of its first two principal axes (section III-A), one point a column.
Eigen::Matrix3Xf in_principal_axes(std::span<const Point> points) {
  const std::size_t step = (points.size() + kMostPoints - 1) / kMostPoints;
  Eigen::Matrix3Xf cloud(3, static_cast<Eigen::Index>((points.size() + step - 1) / step));
  for (Eigen::Index i = 0; i < cloud.cols(); ++i) {
    const Point& p = points[static_cast<std::size_t>(i) * step];
    cloud.col(i) << p.x, p.y, p.z;
  }
  cloud.colwise() -= cloud.rowwise().mean().eval();
  const Eigen::Matrix3f covariance = cloud * cloud.transpose() / static_cast<float>(cloud.cols());
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3f> axes(covariance);  // by rising eigenvalue
  Eigen::Matrix3f R;
  R.row(0) = axes.eigenvectors().col(2).transpose();
  R.row(1) = axes.eigenvectors().col(1).transpose();
  R.row(2) = R.row(0).cross(R.row(1));
  return R * cloud;
}

class M2dp final : public Baseline {
 public:
  std::string name() const override { return "m2dp"; }
  std::string source() const override { return "He, Wang and Zhang, IROS 2016"; }

  Signature describe(std::span<const Point> points, double) const override {
    if (points.empty()) return {Eigen::MatrixXf::Zero(kPlanes + kBins, 1), {}};
    const Eigen::Matrix3Xf cloud = in_principal_axes(points);
    const float farthest = std::max(1e-3f, cloud.colwise().norm().maxCoeff());
    Eigen::MatrixXf counts = Eigen::MatrixXf::Zero(kPlanes, kBins);
    for (int a = 0; a < kAzimuths; ++a)
      for (int e = 0; e < kElevations; ++e) {
        const auto azimuth = static_cast<float>(kPi * a / kAzimuths);
        const auto elevation = static_cast<float>(kPi / 2.0 * e / kElevations);
        const Eigen::Vector3f normal(std::cos(elevation) * std::cos(azimuth), std::cos(elevation) * std::sin(azimuth),
                                     std::sin(elevation));
        // The x axis, projected onto the plane, is the plane's own.
        Eigen::Vector3f u = Eigen::Vector3f::UnitX() - normal.x() * normal;
        u = u.norm() > 1e-3f ? u.normalized() : Eigen::Vector3f::UnitY().cross(normal).normalized();
        const Eigen::Vector3f v = normal.cross(u);
        auto row = counts.row(a * kElevations + e);
        for (Eigen::Index i = 0; i < cloud.cols(); ++i) {
          const float x = u.dot(cloud.col(i)), y = v.dot(cloud.col(i));
          // Circles of radius r, 4 r, 9 r, ...: the square root of the distance counts them.
          const int circle =
              std::min(static_cast<int>(std::sqrt(std::hypot(x, y) / farthest) * kCircles), kCircles - 1);
          const float turns = (std::atan2(y, x) + static_cast<float>(kPi)) / static_cast<float>(2.0 * kPi);
          row[circle * kSectors + std::min(static_cast<int>(turns * kSectors), kSectors - 1)] += 1.f;
        }
      }
    counts /= static_cast<float>(cloud.cols());
    // The first left singular vector, and with it the right one.
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXf> squares(counts * counts.transpose());
    const Eigen::VectorXf left = squares.eigenvectors().col(kPlanes - 1);
    Eigen::MatrixXf result(kPlanes + kBins, 1);
    result << left, (counts.transpose() * left).normalized();
    // Counts are not negative, so neither are the first singular vectors but for a common sign.
    if (result.sum() < 0.f) result = -result;
    return {std::move(result), {}};
  }

  double similarity(const Signature& query, const Signature& place) const override {
    return -static_cast<double>((query.values - place.values).norm());
  }
};

}  // namespace
}  // namespace m2dp

std::unique_ptr<Baseline> make_m2dp() { return std::make_unique<m2dp::M2dp>(); }

}  // namespace revisit::descriptors_internal
