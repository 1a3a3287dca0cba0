// SPDX-License-Identifier: Apache-2.0
#include <revisit/registration/feature_alignment.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include <Eigen/Geometry>

namespace revisit {
namespace {

struct Ransac {
  static constexpr std::size_t kFewestInliers = 10;  ///< of an alignment that is worth refining
  static constexpr int kTrials = 20000;              ///< triples drawn; most end at the first length
  static constexpr double kTolerance_m = 1.0;        ///< a voxel
  static constexpr double kShortestSide_m = 3.0;     ///< of a triple that fixes a rotation
};

struct Match {
  Eigen::Vector3d target, source;
};

// For each column of `a` the nearest of `b`, and the other way round, from one table of distances.
struct NearestColumns {
  std::vector<Eigen::Index> of_a, of_b;
};

NearestColumns nearest_columns(const Eigen::MatrixXf& a, const Eigen::MatrixXf& b) {
  NearestColumns nearest;
  nearest.of_a.resize(static_cast<std::size_t>(a.cols()));
  nearest.of_b.resize(static_cast<std::size_t>(b.cols()), 0);
  const Eigen::VectorXf a_norms = a.colwise().squaredNorm(), b_norms = b.colwise().squaredNorm();
  Eigen::VectorXf least_of_b = Eigen::VectorXf::Constant(b.cols(), std::numeric_limits<float>::infinity());
  constexpr Eigen::Index kBlock = 256;  // keeps the table in the cache
  Eigen::MatrixXf distances;
  for (Eigen::Index begin = 0; begin < a.cols(); begin += kBlock) {
    const Eigen::Index count = std::min(kBlock, a.cols() - begin);
    distances.noalias() = -2.f * (b.transpose() * a.middleCols(begin, count));
    distances.colwise() += b_norms;
    for (Eigen::Index i = 0; i < count; ++i) {
      distances.col(i).minCoeff(&nearest.of_a[static_cast<std::size_t>(begin + i)]);
      const float a_norm = a_norms(begin + i);
      for (Eigen::Index j = 0; j < b.cols(); ++j) {
        const float distance = distances(j, i) + a_norm;
        if (distance < least_of_b(j)) {
          least_of_b(j) = distance;
          nearest.of_b[static_cast<std::size_t>(j)] = begin + i;
        }
      }
    }
  }
  return nearest;
}

std::vector<Match> mutual_matches(const SurfaceCloud& target, const Features& t, const SurfaceCloud& source,
                                  const Features& s) {
  std::vector<Match> matches;
  if (t.points.empty() || s.points.empty()) return matches;
  const NearestColumns nearest = nearest_columns(s.values, t.values);
  for (std::size_t i = 0; i < s.points.size(); ++i) {
    const auto j = static_cast<std::size_t>(nearest.of_a[i]);
    if (nearest.of_b[j] != static_cast<Eigen::Index>(i)) continue;
    matches.push_back({target.point(t.points[j]).cast<double>(), source.point(s.points[i]).cast<double>()});
  }
  return matches;
}

Pose fit(const std::vector<Match>& matches, const std::vector<std::size_t>& chosen) {
  Eigen::Matrix3Xd t(3, static_cast<Eigen::Index>(chosen.size())), s(3, static_cast<Eigen::Index>(chosen.size()));
  for (std::size_t i = 0; i < chosen.size(); ++i) {
    t.col(static_cast<Eigen::Index>(i)) = matches[chosen[i]].target;
    s.col(static_cast<Eigen::Index>(i)) = matches[chosen[i]].source;
  }
  return Pose(Eigen::umeyama(s, t, false));
}

std::vector<std::size_t> agreeing(const std::vector<Match>& matches, const Pose& T, double tolerance_m) {
  std::vector<std::size_t> inliers;
  for (std::size_t i = 0; i < matches.size(); ++i)
    if ((T * matches[i].source - matches[i].target).squaredNorm() < tolerance_m * tolerance_m) inliers.push_back(i);
  return inliers;
}

}  // namespace

std::optional<FeatureAlignment> align_features(const SurfaceCloud& target, const Features& target_features,
                                               const SurfaceCloud& source, const Features& source_features) {
  const std::vector<Match> matches = mutual_matches(target, target_features, source, source_features);
  if (matches.size() < Ransac::kFewestInliers) return std::nullopt;
  std::minstd_rand random(1);
  std::vector<std::size_t> best;
  std::vector<std::size_t> sample(3);
  for (int trial = 0; trial < Ransac::kTrials; ++trial) {
    for (auto& each : sample) each = random() % matches.size();
    // Rigid motion keeps lengths: most wrong samples end here, before anything is fitted.
    bool plausible = true;
    for (std::size_t i = 0; i < 3 && plausible; ++i) {
      const Match &a = matches[sample[i]], &b = matches[sample[(i + 1) % 3]];
      const double in_target = (a.target - b.target).norm(), in_source = (a.source - b.source).norm();
      plausible = in_source > Ransac::kShortestSide_m && std::abs(in_target - in_source) < Ransac::kTolerance_m;
    }
    if (!plausible) continue;
    auto inliers = agreeing(matches, fit(matches, sample), Ransac::kTolerance_m);
    if (inliers.size() > best.size()) best = std::move(inliers);
  }
  if (best.size() < Ransac::kFewestInliers) return std::nullopt;
  FeatureAlignment result;
  result.matches = matches.size();
  result.T_target_source = fit(matches, best);
  result.inliers = agreeing(matches, result.T_target_source, Ransac::kTolerance_m).size();
  return result;
}

}  // namespace revisit
