// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include <Eigen/SVD>

#include <revisit/pose_graph/internal/median.hpp>
#include <revisit/pose_graph/internal/rough_place.hpp>

namespace revisit::pose_graph_internal {
namespace {

struct Placing {
  static constexpr std::size_t kFewest = 4;  ///< fixes of a part
  static constexpr double kWide = 4.0;       ///< how far they must spread, in deviations, to fix a heading
  static constexpr int kRounds = 15;         ///< of reweighting
  static constexpr int kTriples = 200;       ///< of fixes that are tried; with half of them wrong 25 are right
  static constexpr double kNear = 4.0;       ///< times the usual error: fixes that speak for a place
};

// Where weighted points lie best on others: Kabsch, or about the vertical alone.
Pose align(const FixPairs& pairs, const std::vector<double>& weights, bool upright) {
  double sum = 0.0;
  Eigen::Vector3d mean_world = Eigen::Vector3d::Zero(), mean_earth = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < weights.size(); ++i) {
    sum += weights[i];
    mean_world += weights[i] * pairs.world[i];
    mean_earth += weights[i] * pairs.earth[i];
  }
  mean_world /= sum, mean_earth /= sum;
  // One factor less its mean is enough: what the other's mean is multiplied with sums up to nothing.
  Eigen::Matrix3d both = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i < weights.size(); ++i)
    both += weights[i] * (pairs.earth[i] - mean_earth) * pairs.world[i].transpose();
  Pose T = Pose::Identity();
  if (upright) {
    const double yaw_rad = std::atan2(both(1, 0) - both(0, 1), both(0, 0) + both(1, 1));
    T.linear() = Eigen::AngleAxisd(yaw_rad, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  } else {
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(both, Eigen::ComputeFullU | Eigen::ComputeFullV);
    const double sign = (svd.matrixU() * svd.matrixV().transpose()).determinant();
    T.linear() = svd.matrixU() * Eigen::Vector3d(1.0, 1.0, sign).asDiagonal() * svd.matrixV().transpose();
  }
  T.translation() = mean_earth - T.linear() * mean_world;
  return T;
}

// The standard deviation of points along the second of their principal axes, and along the first.
std::pair<double, double> spread_m(const std::vector<Eigen::Vector3d>& points) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const auto& p : points) mean += p;
  mean /= static_cast<double>(points.size());
  Eigen::Matrix3d squares = Eigen::Matrix3d::Zero();
  for (const auto& p : points) squares += (p - mean) * p.transpose();
  const Eigen::Vector3d values =
      Eigen::JacobiSVD<Eigen::Matrix3d>(squares / static_cast<double>(points.size())).singularValues();
  return {std::sqrt(values[1]), std::sqrt(values[0])};
}

// How far off each fix is, in its deviations, if the part lies so.
std::vector<double> errors_of(const FixPairs& pairs, const Pose& T_earth_world) {
  std::vector<double> errors(pairs.world.size());
  for (std::size_t i = 0; i < errors.size(); ++i)
    errors[i] = (T_earth_world * pairs.world[i] - pairs.earth[i]).norm() / pairs.deviation_m[i];
  return errors;
}

// Of the places that three fixes each give, the one that leaves the smallest median error: up to half of the fixes may
// be wrong, and agree with each other (least median of squares; Rousseeuw, 1984).
Pose place_by_three(const FixPairs& pairs, bool upright) {
  std::minstd_rand random(1);
  Pose best = Pose::Identity();
  double least = std::numeric_limits<double>::infinity();
  for (int i = 0; i < Placing::kTriples; ++i) {
    std::vector<double> weights(pairs.world.size(), 0.0);
    for (int k = 0; k < 3; ++k) weights[random() % weights.size()] = 1.0;
    const Pose T = align(pairs, weights, upright);
    const double error = median(errors_of(pairs, T));
    if (error < least) least = error, best = T;
  }
  return best;
}

}  // namespace

std::optional<RoughPlace> place_roughly(const FixPairs& pairs) {
  if (pairs.world.size() < Placing::kFewest) return std::nullopt;
  const double typical_m = median(pairs.deviation_m);
  const auto [across_m, along_m] = spread_m(pairs.world);
  if (along_m < Placing::kWide * typical_m) return std::nullopt;
  const bool upright = across_m < 2.0 * Placing::kWide * typical_m;
  RoughPlace rough{place_by_three(pairs, upright), std::vector<bool>(pairs.world.size())};
  std::vector<double> errors, weights(pairs.world.size());
  double usual = 1.0;
  for (int round = 0; round < Placing::kRounds; ++round) {  // fixes that are far off count for little
    errors = errors_of(pairs, rough.T_earth_world);
    usual = std::max(1.0, median(errors));
    for (std::size_t i = 0; i < weights.size(); ++i)
      weights[i] = 1.0 / std::pow(pairs.deviation_m[i] * (1.0 + std::pow(errors[i] / (2.0 * usual), 2)), 2);
    rough.T_earth_world = align(pairs, weights, upright);
  }
  for (std::size_t i = 0; i < errors.size(); ++i) rough.is_near[i] = errors[i] <= Placing::kNear * usual;
  return rough;
}

}  // namespace revisit::pose_graph_internal
