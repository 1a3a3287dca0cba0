// SPDX-License-Identifier: Apache-2.0
#include <revisit/registration/icp.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_reduce.h>
#include <Eigen/Cholesky>

namespace revisit {
namespace {

using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Vector6 = Eigen::Matrix<double, 6, 1>;

Pose small_motion(const Vector6& xi) {  // rotation first, then translation
  Pose T = Pose::Identity();
  const double angle = xi.head<3>().norm();
  if (angle > 1e-12) T.linear() = Eigen::AngleAxisd(angle, xi.head<3>() / angle).toRotationMatrix();
  T.translation() = xi.tail<3>();
  return T;
}

constexpr double kAllPointsBelow_m = 1.0;
constexpr float kSeenMargin_m = 1.f;  // what ranges within a cell of seen space may be off

// The normal equations of a Gauss-Newton step, summed over points.
struct Equations {
  Matrix6 H = Matrix6::Zero();
  Vector6 g = Vector6::Zero();
  std::size_t pairs = 0;

  void add(const Equations& other) {
    H += other.H;
    g += other.g;
    pairs += other.pairs;
  }
};

// Points [begin, end) of the source in steps of `stride`, at kernel width `width_m`.
Equations equations_of(const SurfaceCloud& target, const SurfaceCloud& source, std::size_t begin, std::size_t end,
                       std::size_t stride, double width_m, const Pose& T) {
  Equations sum;
  const auto reach2 = static_cast<float>(width_m * width_m);
  const double shrink = width_m * width_m / 4.0;
  for (std::size_t i = (begin + stride - 1) / stride * stride; i < end; i += stride) {
    const Eigen::Vector3d p = T * source.point(i).cast<double>();
    const auto neighbour = target.nearest(p.cast<float>(), reach2);
    if (!neighbour) continue;
    const Eigen::Vector3d n = target.normal(neighbour->index).cast<double>();
    if (n.squaredNorm() < 0.5) continue;
    const double residual = n.dot(p - target.point(neighbour->index).cast<double>());
    Vector6 J;
    J << p.cross(n), n;
    const double root = shrink / (shrink + residual * residual), weight = root * root;
    sum.H.noalias() += (weight * J) * J.transpose();
    sum.g += weight * residual * J;
    ++sum.pairs;
  }
  return sum;
}

// One Gauss-Newton step; false where the points do not fix the pose.
bool step(const SurfaceCloud& target, const SurfaceCloud& source, double width_m, Pose& T, double& moved) {
  // While the kernel is wide, some of the points show the way as well as all.
  const std::size_t stride = width_m > kAllPointsBelow_m ? 4 : 1;
  // Split and summed in one order, whatever the number of threads.
  constexpr std::size_t kPointsATask = 1024;
  Equations sum = tbb::parallel_deterministic_reduce(
      tbb::blocked_range<std::size_t>(0, source.size(), kPointsATask * stride), Equations{},
      [&](const tbb::blocked_range<std::size_t>& range, Equations part) {
        part.add(equations_of(target, source, range.begin(), range.end(), stride, width_m, T));
        return part;
      },
      [](Equations a, const Equations& b) {
        a.add(b);
        return a;
      });
  constexpr std::size_t kFewestPairs = 20;
  if (sum.pairs < kFewestPairs) return false;
  sum.H.diagonal().array() += 1e-6 * sum.H.diagonal().maxCoeff();  // a direction that nothing sees stays where it was
  const Vector6 xi = sum.H.ldlt().solve(-sum.g);
  if (!xi.allFinite()) return false;
  T = small_motion(xi) * T;
  moved = xi.head<3>().norm() * 20.0 + xi.tail<3>().norm();  // metres, of a point 20 m away
  return true;
}

// Pearson's correlation of pairs.
struct Correlation {
  double n = 0, x = 0, y = 0, xx = 0, yy = 0, xy = 0;
  void add(double a, double b) { n += 1.0, x += a, y += b, xx += a * a, yy += b * b, xy += a * b; }
  double spread_x() const { return n * xx - x * x; }
  double spread_y() const { return n * yy - y * y; }
  // Intensities that are all alike tell nothing.
  bool is_known() const { return n > 0 && spread_x() > 1e-6 * n * n && spread_y() > 1e-6 * n * n; }
  double value() const { return (n * xy - x * y) / std::sqrt(spread_x() * spread_y()); }
};

struct DirectionalAgreement {
  Correlation intensities;
  std::size_t visible = 0, inliers = 0, seen_through = 0;
  double squared_sum = 0.0;
};

// The share of the points above ground of `from` that lie on a surface of `to`.
DirectionalAgreement agreement_one_way(const SurfaceCloud& to, const SurfaceCloud& from, const Pose& T_to_from,
                                       double inlier_distance_m, double farthest_m) {
  DirectionalAgreement result;
  constexpr double kReach = 2.5;  // in-plane distance to the nearest centroid, in inlier distances
  const auto reach2 = static_cast<float>(std::pow(kReach * inlier_distance_m, 2));
  for (std::size_t i = 0; i < from.size(); ++i) {
    if (from.is_ground(i)) continue;
    const Eigen::Vector3d p = T_to_from * from.point(i).cast<double>();
    if (p.norm() > farthest_m) continue;
    ++result.visible;
    const auto neighbour = to.nearest(p.cast<float>(), reach2);
    double distance = std::numeric_limits<double>::infinity();
    if (neighbour) {
      const Eigen::Vector3d n = to.normal(neighbour->index).cast<double>();
      const Eigen::Vector3d d = p - to.point(neighbour->index).cast<double>();
      distance = n.squaredNorm() < 0.5 ? d.norm() : std::abs(n.dot(d));
    }
    if (distance <= inlier_distance_m) {
      ++result.inliers;
      result.intensities.add(static_cast<double>(from.intensity(i)),
                             static_cast<double>(to.intensity(neighbour->index)));
      result.squared_sum += distance * distance;
    } else if (to.seen().look(p.cast<float>(), kSeenMargin_m) == SeenSpace::Verdict::kThrough) {
      ++result.seen_through;
    }
  }
  return result;
}

double range_that_holds_most(const SurfaceCloud& cloud) {
  std::vector<float> ranges;
  for (std::size_t i = 0; i < cloud.size(); ++i)
    if (!cloud.is_ground(i)) ranges.push_back(cloud.point(i).norm());
  if (ranges.empty()) return 0.0;
  const auto rank = ranges.begin() + static_cast<std::ptrdiff_t>(static_cast<double>(ranges.size() - 1) * 0.95);
  std::nth_element(ranges.begin(), rank, ranges.end());
  return static_cast<double>(*rank);
}

}  // namespace

IcpResult align_icp(const SurfaceCloud& target, const SurfaceCloud& source, const Pose& T_guess_target_source,
                    double coarse_m, double fine_m) {
  IcpResult result;
  result.T_target_source = T_guess_target_source;
  if (target.size() == 0 || source.size() == 0) return result;
  constexpr int kMostIterations = 60;
  constexpr double kShrink = 0.7, kSteady = 0.03, kSettled_m = 2e-4;
  double width_m = coarse_m;
  for (; result.iterations < kMostIterations; ++result.iterations) {
    double moved = 0.0;
    if (!step(target, source, width_m, result.T_target_source, moved)) return result;
    const bool fine = width_m <= fine_m;
    if (fine && moved < kSettled_m) {
      result.converged = true;
      break;
    }
    if (moved < kSteady * width_m) width_m = std::max(fine_m, width_m * kShrink);
  }
  return result;
}

Agreement measure_agreement(const SurfaceCloud& target, const SurfaceCloud& source, const Pose& T_target_source,
                            double inlier_distance_m) {
  const double target_range = range_that_holds_most(target), source_range = range_that_holds_most(source);
  const auto forth = agreement_one_way(target, source, T_target_source, inlier_distance_m, target_range);
  const auto back = agreement_one_way(source, target, T_target_source.inverse(), inlier_distance_m, source_range);
  const auto ratio = [](const DirectionalAgreement& a) {
    constexpr std::size_t kFewestPoints = 50;  // of fewer, nothing can be said
    return a.visible < kFewestPoints ? 0.0 : static_cast<double>(a.inliers) / static_cast<double>(a.visible);
  };
  Agreement result;
  result.inlier_ratio = std::min(ratio(forth), ratio(back));
  const auto undisputed = [](const DirectionalAgreement& a) {
    const std::size_t known = a.inliers + a.seen_through;
    return known == 0 ? 0.0 : static_cast<double>(a.inliers) / static_cast<double>(known);
  };
  result.free_space_agreement = std::min(undisputed(forth), undisputed(back));
  if (forth.intensities.is_known() && back.intensities.is_known())
    result.intensity_correlation = std::min(forth.intensities.value(), back.intensities.value());
  const std::size_t inliers = forth.inliers + back.inliers;
  if (inliers > 0) result.rmse_m = std::sqrt((forth.squared_sum + back.squared_sum) / static_cast<double>(inliers));
  return result;
}

}  // namespace revisit
