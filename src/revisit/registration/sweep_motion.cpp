// SPDX-License-Identifier: Apache-2.0
#include <revisit/registration/sweep_motion.hpp>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <unordered_set>
#include <vector>

#include <Eigen/Cholesky>

namespace revisit {
namespace {

struct Sweep {
  static constexpr std::size_t kLookedAt = 8000;              ///< points of the scan, evenly taken
  static constexpr double kVoxel_m = 1.0;                     ///< of which one a voxel counts
  static constexpr std::size_t kFewestPairs = 50;             ///< on the surface
  static constexpr double kWidth_m[] = {1.5, 1.0, 0.7, 0.5};  ///< of the kernel
  static constexpr int kMostSteps = 15;                       ///< with each of them
  static constexpr double kSteady = 0.02;  ///< done with a width where a point at kArm_m moves less, in widths
  static constexpr double kArm_m = 20.0;
  // What sensors move at, standard deviations: along the ground, up and down; turns about the vertical, and others.
  static constexpr double kLinear_mps = 10.0, kVertical_mps = 0.5, kTurn_radps = 1.0, kTilt_radps = 0.3;
  static constexpr double kNoise_m = 0.3;  ///< of a point on the surface, with all that is not modelled
  static constexpr double kMost_m = 2.0;   ///< that the pose may move from the guess
  static constexpr double kFastestInRooms_mps = 3.0;
};

struct SweptPoint {
  Eigen::Vector3d position_m;
  double time_s;
};

std::vector<SweptPoint> thinned(const Scan& scan) {
  std::vector<SweptPoint> points;
  std::unordered_set<std::uint64_t> taken;
  const std::size_t step = std::max<std::size_t>(1, scan.points.size() / Sweep::kLookedAt);
  for (std::size_t i = 0; i < scan.points.size(); i += step) {
    const Point& p = scan.points[i];
    const auto cell = [](float metres) {
      return static_cast<std::uint64_t>(
          static_cast<std::int64_t>(std::floor(static_cast<double>(metres) / Sweep::kVoxel_m)) & 0xfffff);
    };
    if (taken.insert(cell(p.x) << 40 | cell(p.y) << 20 | cell(p.z)).second)
      points.push_back({Eigen::Vector3f(p.x, p.y, p.z).cast<double>(), static_cast<double>(scan.times_s[i])});
  }
  return points;
}

double moved_at_arm_m(const Vector6& xi) { return xi.head<3>().norm() + Sweep::kArm_m * xi.tail<3>().norm(); }

using Matrix12 = Eigen::Matrix<double, 12, 12>;
using Vector12 = Eigen::Matrix<double, 12, 1>;

}  // namespace

std::optional<SweepMotion> find_sweep_motion(const Surface& target, const Scan& scan, const Pose& T_guess_target_source,
                                             bool in_the_open) {
  if (scan.times_s.empty()) return std::nullopt;
  const std::vector<SweptPoint> points = thinned(scan);
  SweepMotion found{T_guess_target_source, {}};
  Vector6 deviations;
  deviations << Sweep::kLinear_mps, Sweep::kLinear_mps, Sweep::kVertical_mps, Sweep::kTilt_radps, Sweep::kTilt_radps,
      Sweep::kTurn_radps;
  double sweep_s = 0.0;
  for (const SweptPoint& each : points) sweep_s = std::max(sweep_s, std::abs(each.time_s));
  const Vector6 prior = (Sweep::kNoise_m * Sweep::kNoise_m) * deviations.cwiseAbs2().cwiseInverse();
  std::size_t width = 0;
  for (int steps = 0; width < std::size(Sweep::kWidth_m);) {
    const double width_m = Sweep::kWidth_m[width];
    // Of a small motion of the pose, and of a change of the twist: a point at time t feels t times the latter.
    Matrix12 H = Matrix12::Zero();
    Vector12 g = Vector12::Zero();
    std::size_t pairs = 0;
    for (const SweptPoint& each : points) {
      const Eigen::Vector3d q = motion_after(found.motion, each.time_s) * each.position_m;
      const Eigen::Vector3d p = found.T_target_source * q;
      Surface::Patch patch;
      if (!target.nearest_patch(p.cast<float>(), static_cast<float>(width_m * width_m), patch) || patch.normal.isZero())
        continue;
      ++pairs;
      const Eigen::Vector3d normal = found.T_target_source.linear().transpose() * patch.normal.cast<double>();
      const double residual_m = patch.normal.cast<double>().dot(p - patch.point.cast<double>());
      const double root = width_m * width_m / (width_m * width_m + 16.0 * residual_m * residual_m);
      Vector12 row;
      row.head<3>() = normal;
      row.segment<3>(3) = q.cross(normal);
      row.tail<6>() = each.time_s * row.head<6>();
      H.selfadjointView<Eigen::Lower>().rankUpdate(row, root * root);
      g += root * root * residual_m * row;
    }
    if (pairs < Sweep::kFewestPairs) return std::nullopt;
    Vector6 twist;
    twist << found.motion.linear_mps, found.motion.angular_radps;
    H.diagonal().tail<6>() += prior;
    g.tail<6>() += prior.cwiseProduct(twist);
    const Vector12 step = -H.selfadjointView<Eigen::Lower>().ldlt().solve(g);
    if (!step.allFinite()) return std::nullopt;
    found.T_target_source = found.T_target_source * small_motion(step.head<6>());
    found.motion.linear_mps += step.segment<3>(6);
    found.motion.angular_radps += step.tail<3>();
    const double moved_m = moved_at_arm_m(step.head<6>()) + sweep_s * moved_at_arm_m(step.tail<6>());
    if (++steps == Sweep::kMostSteps || moved_m < Sweep::kSteady * width_m) ++width, steps = 0;
  }
  const Pose moved = T_guess_target_source.inverse() * found.T_target_source;
  if (moved.translation().norm() > Sweep::kMost_m) return std::nullopt;
  if (!in_the_open && found.motion.linear_mps.norm() > Sweep::kFastestInRooms_mps) return std::nullopt;
  return found;
}

}  // namespace revisit
