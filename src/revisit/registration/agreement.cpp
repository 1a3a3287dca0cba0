// SPDX-License-Identifier: Apache-2.0
#include <revisit/registration/agreement.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include <oneapi/tbb/parallel_invoke.h>

namespace revisit {
namespace {

struct Measures {
  static constexpr double kReach = 2.5;             ///< in-plane distance to the nearest centroid, in inlier distances
  static constexpr double kSeenMargin = 2.5;        ///< what ranges within a cell of seen space may be off, likewise
  static constexpr std::size_t kFewestPoints = 50;  ///< of fewer, nothing can be said
};

// Spearman's correlation of pairs of intensities in [0, 1]: of their ranks, since sensors respond to the same surface
// each by a curve of its own. Ranks to 1 in 256.
class RankCorrelation {
 public:
  void reserve(std::size_t pairs) { pairs_.reserve(pairs); }
  void add(float a, float b) { pairs_.emplace_back(bin(a), bin(b)); }
  /// Nothing where either side is all alike.
  std::optional<double> value() const {
    std::array<double, kBins> a{}, b{};
    for (const auto& [of_a, of_b] : pairs_) a[of_a] += 1.0, b[of_b] += 1.0;
    to_centred_ranks(a);
    to_centred_ranks(b);
    double aa = 0.0, bb = 0.0, ab = 0.0;
    for (const auto& [of_a, of_b] : pairs_) {
      const double x = a[of_a], y = b[of_b];
      aa += x * x, bb += y * y, ab += x * y;
    }
    const double least_spread = 1e-6 * static_cast<double>(pairs_.size());
    if (!(aa > least_spread && bb > least_spread)) return std::nullopt;
    return ab / std::sqrt(aa * bb);
  }

 private:
  static constexpr std::size_t kBins = 256;
  static std::uint8_t bin(float intensity) {
    return static_cast<std::uint8_t>(255.f * std::clamp(intensity, 0.f, 1.f));
  }
  // From how often each value occurs to its mean rank, in shares of all, around 0.
  void to_centred_ranks(std::array<double, kBins>& counts) const {
    const double share = 1.0 / static_cast<double>(pairs_.size());
    double below = 0.0;
    for (double& each : counts) {
      const double count = each;
      each = (below + 0.5 * count) * share - 0.5;
      below += count;
    }
  }
  std::vector<std::pair<std::uint8_t, std::uint8_t>> pairs_;
};

struct DirectionalAgreement {
  RankCorrelation intensities;
  std::size_t visible = 0, inliers = 0, seen_through = 0, hidden = 0;
  double squared_sum = 0.0;
  Eigen::Matrix3d normals = Eigen::Matrix3d::Zero();  // sum of n n^T over the inliers

  double ratio() const { return share(inliers, visible); }
  double in_sight_ratio() const { return share(inliers, visible - hidden); }
  double hidden_share() const { return share(hidden, visible); }
  static double share(std::size_t some, std::size_t all) {
    return all < Measures::kFewestPoints ? 0.0 : static_cast<double>(some) / static_cast<double>(all);
  }
  // Of the directions at right angles to `up`, the mean square of the normals along the one where it is least.
  double least_fixed(const Eigen::Vector3d& up) const {
    if (inliers == 0) return 0.0;
    const Eigen::Vector3d x = up.unitOrthogonal(), y = up.cross(x);
    const double xx = x.dot(normals * x), yy = y.dot(normals * y), xy = x.dot(normals * y);
    return (0.5 * (xx + yy) - std::sqrt(0.25 * (xx - yy) * (xx - yy) + xy * xy)) / static_cast<double>(inliers);
  }
};

// The share of the points above ground of `from` that lie on a surface of `to`.
DirectionalAgreement agreement_one_way(const SurfaceCloud& to, const SurfaceCloud& from, const Pose& T_to_from,
                                       double inlier_distance_m) {
  DirectionalAgreement result;
  result.intensities.reserve(from.size());
  const auto seen_margin_m = static_cast<float>(Measures::kSeenMargin * inlier_distance_m);
  const auto reach2 = static_cast<float>(std::pow(Measures::kReach * inlier_distance_m, 2));
  for (std::size_t i = 0; i < from.size(); ++i) {
    if (from.is_ground(i)) continue;
    const Eigen::Vector3d p = T_to_from * from.point(i).cast<double>();
    if (!to.view().holds(p.cast<float>())) continue;
    ++result.visible;
    const auto neighbour = to.nearest(p.cast<float>(), reach2);
    double distance = std::numeric_limits<double>::infinity();
    Eigen::Vector3d n = Eigen::Vector3d::Zero();
    if (neighbour) {
      n = to.normal(neighbour->index).cast<double>();
      const Eigen::Vector3d d = p - to.point(neighbour->index).cast<double>();
      distance = n.squaredNorm() < 0.5 ? d.norm() : std::abs(n.dot(d));
    }
    if (distance <= inlier_distance_m) {
      ++result.inliers;
      result.normals.noalias() += n * n.transpose();
      result.intensities.add(from.intensity(i), to.intensity(neighbour->index));
      result.squared_sum += distance * distance;
    } else {
      const SeenSpace::Verdict verdict = to.seen().look(p.cast<float>(), seen_margin_m);
      if (verdict == SeenSpace::Verdict::kThrough) ++result.seen_through;
      if (verdict == SeenSpace::Verdict::kHidden) ++result.hidden;
    }
  }
  return result;
}

}  // namespace

Agreement measure_agreement(const SurfaceCloud& target, const SurfaceCloud& source, const Pose& T_target_source,
                            double inlier_distance_m) {
  DirectionalAgreement forth, back;
  tbb::parallel_invoke([&] { forth = agreement_one_way(target, source, T_target_source, inlier_distance_m); },
                       [&] { back = agreement_one_way(source, target, T_target_source.inverse(), inlier_distance_m); });
  Agreement result;
  result.inlier_ratio = std::min(forth.ratio(), back.ratio());
  result.in_sight_ratio = std::min(forth.in_sight_ratio(), back.in_sight_ratio());
  result.hidden_share = std::max(forth.hidden_share(), back.hidden_share());
  result.least_fixed =
      std::min(forth.least_fixed(target.up().cast<double>()), back.least_fixed(source.up().cast<double>()));
  result.inliers = std::min(forth.inliers, back.inliers);
  const auto undisputed = [](const DirectionalAgreement& a) {
    const std::size_t known = a.inliers + a.seen_through;
    return known == 0 ? 0.0 : static_cast<double>(a.inliers) / static_cast<double>(known);
  };
  result.free_space_agreement = std::min(undisputed(forth), undisputed(back));
  const auto forth_intensity = forth.intensities.value(), back_intensity = back.intensities.value();
  if (forth_intensity && back_intensity) result.intensity_correlation = std::min(*forth_intensity, *back_intensity);
  const std::size_t inliers = forth.inliers + back.inliers;
  if (inliers > 0) result.rmse_m = std::sqrt((forth.squared_sum + back.squared_sum) / static_cast<double>(inliers));
  return result;
}

}  // namespace revisit
