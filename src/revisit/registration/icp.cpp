// SPDX-License-Identifier: Apache-2.0
#include <revisit/registration/icp.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_reduce.h>
#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

namespace revisit {
namespace {

struct Steps {
  static constexpr double kAllPointsBelow_m = 1.0;  ///< kernel width: while wider, a quarter of the points will do
  static constexpr std::size_t kStrideWhereWide = 4;
  static constexpr int kMostOfSome = 40;  ///< steps with some of the points, which may go to and fro for ever
  static constexpr std::size_t kPointsATask = 1024;
  static constexpr std::size_t kFewestPairs = 20;
  static constexpr double kShrink = 0.7;       ///< of the kernel's width, once the pose is steady
  static constexpr double kSteady = 0.03;      ///< motion of a point 20 m away, in kernel widths
  static constexpr double kToAndFro_m = 0.01;  ///< the same, where neighbours change to and fro: converged
  static constexpr double kAcross = 1e-3;      ///< covariance across a plane, 1 along it (Segal et al., RSS 2009)
  static constexpr double kArm_m = 10.0;       ///< at which turns are weighed against translations
  static constexpr int kMostTilts = 10;        ///< steps of height and tilt alone
  // Points share the errors of the surfaces that they lie on, so that they count for fewer than they are.
  static constexpr double kPointsThatCountAsOne = 10.0, kLeastNoise_m = 0.02;
  static constexpr double kSurface_m = 0.01;  ///< standard deviation where all surfaces face one direction
};

// The normal equations of a Gauss-Newton step (metres, then radians about the source's origin, both along the target's
// axes), summed over points. About the target's origin, which a map may have a kilometre away, turns and translations
// would be next to inseparable.
struct Equations {
  Matrix6 H = Matrix6::Zero();
  Vector6 g = Vector6::Zero();
  double weights = 0.0, weighted_squares_m2 = 0.0;
  double certain = 0.0;  ///< sum of what is in H: weights, less for uncertain patches
  std::size_t pairs = 0;

  // The Geman-McClure weight of a squared residual.
  double weigh(double squared_m2, double shrink_m2) {
    const double root = shrink_m2 / (shrink_m2 + squared_m2), weight = root * root;
    weights += weight;
    weighted_squares_m2 += weight * squared_m2;
    return weight;
  }
  void add(const Equations& other) {
    H += other.H;
    g += other.g;
    weights += other.weights;
    certain += other.certain;
    weighted_squares_m2 += other.weighted_squares_m2;
    pairs += other.pairs;
  }
};

using Points = std::span<const Eigen::Vector3f>;

Eigen::Matrix3d cross_matrix(const Eigen::Vector3d& p) {
  Eigen::Matrix3d m;
  m << 0, -p.z(), p.y(), p.z(), 0, -p.x(), -p.y(), p.x(), 0;
  return m;
}

// The metric of generalised ICP between two patches, scaled so that parallel planes count by their distance alone:
// the inverse of the sum of covariances that are 1 along a plane and next to nothing across it.
Eigen::Matrix3d plane_to_plane(const Eigen::Vector3d& n, const Eigen::Vector3d& m) {
  const Eigen::Matrix3d covariance =
      2.0 * Eigen::Matrix3d::Identity() - (1.0 - Steps::kAcross) * (n * n.transpose() + m * m.transpose());
  return 2.0 * Steps::kAcross * covariance.inverse();
}

// The patches that the points of the source met last: from one step to the next few change, so that only what is nearer
// needs looking for. One task a point at a time.
class Met {
 public:
  explicit Met(std::size_t points) : patches_(points) {
    for (Surface::Patch& each : patches_) each.point.setConstant(std::numeric_limits<float>::infinity());
  }
  // The patch nearest to source point `i`, which now lies at `p` in the target's frame; null where none is in reach.
  const Surface::Patch* nearest(const Surface& target, std::size_t i, const Eigen::Vector3f& p,
                                float squared_reach_m2) {
    Surface::Patch& patch = patches_[i];
    const float last_m2 = (patch.point - p).squaredNorm();
    const bool is_nearer = target.nearest_patch(p, std::min(squared_reach_m2, last_m2), patch);
    return is_nearer || last_m2 < squared_reach_m2 ? &patch : nullptr;
  }

 private:
  std::vector<Surface::Patch> patches_;
};

// What a patch counts for (IcpOptions::noise_m).
double share_of(const Surface::Patch& patch, double noise_m) {
  if (noise_m <= 0.0) return 1.0;
  const double squared_m2 = noise_m * noise_m;
  return squared_m2 / (squared_m2 + static_cast<double>(patch.variance_m2));
}

// The direction along which a patch fixes the pose. Rings of beams on level ground stand still in the sensor's frame,
// and the noise in the normals of their patches would hold the sensor back: what faces along the rings' axis fixes
// nothing across it.
Eigen::Vector3d fixed_by(const Eigen::Vector3d& normal, const Pose& T, double least_cosine) {
  const Eigen::Vector3d z_axis = T.linear().col(2);
  const double cosine = normal.dot(z_axis);
  return std::abs(cosine) > least_cosine ? Eigen::Vector3d(std::copysign(1.0, cosine) * z_axis) : normal;
}

// How the source is stepped through: while the kernel is wide, or the pose far from settled, some of its points give
// the step as well as all.
std::size_t stride_of(std::size_t points, std::size_t settles_with, double width_m) {
  const std::size_t stride = settles_with > 0 ? std::max(std::size_t{1}, points / settles_with) : 1;
  return width_m > Steps::kAllPointsBelow_m ? std::max(Steps::kStrideWhereWide, stride) : stride;
}

// Points [begin, end) of the source in steps of `stride`, at kernel width `width_m`.
Equations equations_of(const Surface& target, Points source, const IcpOptions& options, std::size_t begin,
                       std::size_t end, std::size_t stride, double width_m, double noise_m, const Pose& T, Met& met) {
  const Points source_normals = options.source_normals;
  const double reach_m = std::max(width_m, options.least_reach_m);
  const double least_cosine =
      options.level_deg > 0.0 ? std::cos(to_radians(options.level_deg)) : std::numeric_limits<double>::infinity();
  Equations sum;
  const auto reach2 = static_cast<float>(reach_m * reach_m);
  const double shrink = width_m * width_m / 4.0;
  for (std::size_t i = (begin + stride - 1) / stride * stride; i < end; i += stride) {
    const Eigen::Vector3d p = T * source[i].cast<double>();
    const Surface::Patch* patch = met.nearest(target, i, p.cast<float>(), reach2);
    if (patch == nullptr) continue;
    const Eigen::Vector3d n = patch->normal.cast<double>(), d = p - patch->point.cast<double>();
    if (n.squaredNorm() < 0.5) continue;
    if (source_normals.empty()) {
      const Eigen::Vector3d along = fixed_by(n, T, least_cosine);
      Vector6 J;
      J << along, (p - T.translation()).cross(along);
      const double residual = n.dot(d);
      const double weight = sum.weigh(residual * residual, shrink) * share_of(*patch, noise_m);
      sum.H.noalias() += (weight * J) * J.transpose();
      sum.g += weight * residual * J;
      sum.certain += weight;
    } else {
      const Eigen::Matrix3d metric = plane_to_plane(n, T.linear() * source_normals[i].cast<double>());
      Eigen::Matrix<double, 3, 6> J;
      J << Eigen::Matrix3d::Identity(), -cross_matrix(p - T.translation());
      const double weight = sum.weigh(d.dot(metric * d), shrink);
      sum.H.noalias() += weight * J.transpose() * metric * J;
      sum.g.noalias() += weight * J.transpose() * (metric * d);
      sum.certain += weight;
    }
    ++sum.pairs;
  }
  return sum;
}

double variance_of_surfaces_m2(const Equations& sum) { return sum.certain * Steps::kSurface_m * Steps::kSurface_m; }

// What the equations at T say about its error, seen from the source.
Matrix6 information_of(const Equations& sum, const Pose& T) {
  const double variance_m2 =
      std::max(Steps::kLeastNoise_m * Steps::kLeastNoise_m, sum.weighted_squares_m2 / sum.weights);
  Matrix6 axes = Matrix6::Zero();
  axes.topLeftCorner<3, 3>() = axes.bottomRightCorner<3, 3>() = T.linear();
  return axes.transpose() * sum.H * axes / (Steps::kPointsThatCountAsOne * variance_m2);
}

// The same of the position alone.
Eigen::Matrix3d position_information_of(const Equations& sum, const Pose& T) {
  const Eigen::Matrix3d turns = sum.H.bottomRightCorner<3, 3>(), both = sum.H.topRightCorner<3, 3>();
  const Eigen::Matrix3d alone = sum.H.topLeftCorner<3, 3>() - both * turns.ldlt().solve(both.transpose());
  if (!alone.allFinite()) return Eigen::Matrix3d::Zero();
  return T.linear().transpose() * alone * T.linear() / variance_of_surfaces_m2(sum);
}

void add_prior(const PosePrior& prior, const Pose& T, Equations& sum) {
  const double variance_m2 = variance_of_surfaces_m2(sum);
  const Eigen::Matrix3d of_position = variance_m2 * prior.position_information,
                        of_rotation = variance_m2 * prior.rotation_information;
  const Eigen::AngleAxisd turned(T.linear() * prior.T_target_source.linear().transpose());
  sum.H.topLeftCorner<3, 3>() += of_position;
  sum.H.bottomRightCorner<3, 3>() += of_rotation;
  sum.g.head<3>() += of_position * (T.translation() - prior.T_target_source.translation());
  sum.g.tail<3>() += of_rotation * (turned.angle() * turned.axis());
}

// The step without its part along directions that next to nothing fixes (Zhang et al., "On degeneracy of
// optimization-based state estimation problems", ICRA 2016).
Vector6 seen_part(const Vector6& xi, const Equations& sum, double least_seen) {
  Vector6 scale;
  scale << Eigen::Vector3d::Ones(), Eigen::Vector3d::Constant(Steps::kArm_m);
  const Matrix6 per_point = scale.cwiseInverse().asDiagonal() * sum.H * scale.cwiseInverse().asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Matrix6> axes(per_point / sum.certain);
  const Vector6 along = axes.eigenvectors().transpose() * scale.cwiseProduct(xi);
  const Vector6 seen = (axes.eigenvalues().array() < least_seen).select(Vector6::Zero(), along);
  return scale.cwiseInverse().cwiseProduct(axes.eigenvectors() * seen);
}

// Rings of beams turn about the source's z axis: the patches that they make of one scan stand still along these three
// directions, and along these alone.
Eigen::Matrix<double, 6, 3> height_and_tilt(const Eigen::Matrix3d& rotation) {
  Eigen::Matrix<double, 6, 3> axes = Eigen::Matrix<double, 6, 3>::Zero();
  axes.block<3, 1>(0, 0) = rotation.col(2);
  axes.bottomRightCorner<3, 2>() = rotation.leftCols<2>();
  return axes;
}

Vector6 solution(const Equations& sum, const Pose& T, double noise_m) {
  if (noise_m <= 0.0) return sum.H.ldlt().solve(-sum.g);
  const Eigen::Matrix<double, 6, 3> axes = height_and_tilt(T.linear());
  return axes * Eigen::Matrix3d(axes.transpose() * sum.H * axes).ldlt().solve(-axes.transpose() * sum.g);
}

// One Gauss-Newton step; false where the points do not fix the pose.
bool step(const Surface& target, Points source, const IcpOptions& options, std::size_t stride, double width_m,
          double noise_m, Met& met, IcpResult& result, double& moved) {
  Pose& T = result.T_target_source;
  // Split and summed in one order, whatever the number of threads.
  Equations sum = tbb::parallel_deterministic_reduce(
      tbb::blocked_range<std::size_t>(0, source.size(), Steps::kPointsATask * stride), Equations{},
      [&](const tbb::blocked_range<std::size_t>& range, Equations part) {
        part.add(equations_of(target, source, options, range.begin(), range.end(), stride, width_m, noise_m, T, met));
        return part;
      },
      [](Equations a, const Equations& b) {
        a.add(b);
        return a;
      });
  if (!source.empty()) {
    const double share = static_cast<double>(stride) / static_cast<double>(source.size());
    result.matched = share * sum.weights;
    const Eigen::Matrix3d faced = sum.H.topLeftCorner<3, 3>();
    const Eigen::Vector3d z_axis = result.T_target_source.linear().col(2);
    result.matched_sideways = share * (faced.trace() - z_axis.dot(faced * z_axis));
    result.met = share * static_cast<double>(sum.pairs);
  }
  if (sum.pairs < Steps::kFewestPairs) return false;
  result.information = information_of(sum, T);
  result.position_information = position_information_of(sum, T);
  if (options.prior && noise_m <= 0.0) add_prior(*options.prior, T, sum);
  sum.H.diagonal().array() += 1e-6 * sum.H.diagonal().maxCoeff();  // a direction that nothing sees stays where it was
  Vector6 xi = solution(sum, T, noise_m);
  if (options.least_seen > 0.0) xi = seen_part(xi, sum, options.least_seen);
  if (!xi.allFinite()) return false;
  const Pose small = small_motion(xi);
  T.linear() = small.linear() * T.linear();
  T.translation() += small.translation();
  moved = xi.tail<3>().norm() * 20.0 + xi.head<3>().norm();  // metres, of a point 20 m away
  return true;
}

}  // namespace

IcpResult align_icp(const Surface& target, std::span<const Eigen::Vector3f> source, const Pose& T_guess_target_source,
                    const IcpOptions& options) {
  IcpResult result;
  result.T_target_source = T_guess_target_source;
  double width_m = options.coarse_m;
  Met met(source.size());
  std::size_t settles_with = options.settles_with;
  for (; result.iterations < options.most_iterations; ++result.iterations) {
    double moved = 0.0;
    result.converged = false;
    if (result.iterations == Steps::kMostOfSome) settles_with = 0;
    const std::size_t stride = stride_of(source.size(), settles_with, width_m);
    if (!step(target, source, options, stride, width_m, 0.0, met, result, moved)) break;
    result.last_step_m = moved;
    const bool fine = width_m <= options.fine_m;
    if (fine && stride > 1) {
      if (moved < Steps::kToAndFro_m) settles_with = 0;
      continue;
    }
    if (fine && result.matched < options.least_matched) break;
    result.converged = fine && moved < Steps::kToAndFro_m;
    if (fine && moved < options.settled_m) break;
    if (moved < Steps::kSteady * width_m) width_m = std::max(options.fine_m, width_m * Steps::kShrink);
  }
  // Whether it converged is known before: all count alike until then, who see farther together.
  if (options.noise_m > 0.0 && result.converged) {
    IcpResult tilted = result;
    double moved = options.settled_m;
    for (int i = 0; i < Steps::kMostTilts && moved >= options.settled_m; ++i)
      if (!step(target, source, options, 1, width_m, options.noise_m, met, tilted, moved)) return result;
    result.T_target_source = tilted.T_target_source;
  }
  return result;
}

double largest_stddev_m(const Matrix6& information) {
  const Eigen::LLT<Matrix6> factor(information);
  if (factor.info() != Eigen::Success) return std::numeric_limits<double>::infinity();
  const Matrix6 covariance = factor.solve(Matrix6::Identity());
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(covariance.topLeftCorner<3, 3>(), Eigen::EigenvaluesOnly);
  return std::sqrt(std::max(0.0, axes.eigenvalues()(2)));
}

}  // namespace revisit
