// SPDX-License-Identifier: Apache-2.0
// Kim, Choi and Kim, "Scan Context++: Structural Place Recognition Robust to Rotation and Lateral Variations in Urban
// Environments", T-RO 2022, the augmented polar context: the query is described three times, from where the sensor was
// and from a lane (2 m) to its left and right; the aligning key (the mean of each column) gives the turn, and columns
// are compared by cosines within a twentieth of a circle of it. Every place is compared, so that the retrieval key's
// misses do not count.
#include <algorithm>
#include <array>
#include <limits>

#include <revisit/descriptors/internal/baselines.hpp>
#include <revisit/descriptors/internal/polar_heights.hpp>

namespace revisit::descriptors_internal {
namespace scan_context_pp {
namespace {

constexpr float kLane_m = 2.f;
constexpr std::array kLeft_m{0.f, kLane_m, -kLane_m};
constexpr Eigen::Index kSectors = 60;  // of polar_heights()
constexpr Eigen::Index kReach = 3;     // of them, to both sides

// By how many columns `place` is turned against `query`: where the means of their columns differ least (L1).
Eigen::Index shift_of(const Eigen::VectorXf& query, const Eigen::VectorXf& place) {
  const Eigen::Index sectors = query.size();
  Eigen::Index best = 0;
  float least = std::numeric_limits<float>::infinity();
  for (Eigen::Index shift = 0; shift < sectors; ++shift) {
    const Eigen::Index rest = sectors - shift;
    const float difference =
        (query.head(rest) - place.tail(rest)).lpNorm<1>() + (query.tail(shift) - place.head(shift)).lpNorm<1>();
    if (difference < least) least = difference, best = shift;
  }
  return best;
}

double mean_cosine(const Eigen::MatrixXf& query, const Eigen::VectorXf& query_scale, const Eigen::MatrixXf& place,
                   const Eigen::VectorXf& place_scale, Eigen::Index shift) {
  double sum = 0.0;
  int columns = 0;
  for (Eigen::Index j = 0; j < query.cols(); ++j) {
    const Eigen::Index k = (j + shift) % query.cols();
    if (query_scale[j] <= 0.f || place_scale[k] <= 0.f) continue;
    sum += static_cast<double>(query.col(j).dot(place.col(k)) * query_scale[j] * place_scale[k]);
    ++columns;
  }
  return columns > 0 ? sum / columns : 0.0;
}

class ScanContextPlusPlus final : public TurnMethod {
 public:
  ScanContextPlusPlus() : TurnMethod(kSectors) {}
  std::string name() const override { return "scan-context++"; }
  std::string source() const override { return "Kim, Choi and Kim, T-RO 2022; augmented polar context"; }

  Signature describe(std::span<const Point> points, double ground_z_m) const override {
    Signature signature;
    for (std::size_t copy = 0; copy < kLeft_m.size(); ++copy) {
      const Eigen::MatrixXf image = polar_heights(points, ground_z_m, kLeft_m[copy]);
      if (copy == 0) signature.values.resize(image.rows(), image.cols() * static_cast<Eigen::Index>(kLeft_m.size()));
      signature.values.middleCols(image.cols() * static_cast<Eigen::Index>(copy), image.cols()) = image;
    }
    return signature;
  }

  Signature kept(Signature signature) const override {
    return {signature.values.leftCols(signature.values.cols() / static_cast<Eigen::Index>(kLeft_m.size())), {}};
  }

 private:
  Turn best_turn(const Signature& query, const Signature& place) const override {
    const Eigen::Index sectors = query.values.cols() / static_cast<Eigen::Index>(kLeft_m.size());
    const Eigen::MatrixXf own = place.values.leftCols(sectors);
    const Eigen::VectorXf own_key = own.colwise().mean(), own_scale = inverse_lengths(own);
    Turn best;
    for (Eigen::Index copy = 0; copy < static_cast<Eigen::Index>(kLeft_m.size()); ++copy) {
      const Eigen::MatrixXf image = query.values.middleCols(copy * sectors, sectors);
      const Eigen::VectorXf scale = inverse_lengths(image);
      const Eigen::Index middle = shift_of(image.colwise().mean(), own_key);
      for (Eigen::Index offset = -kReach; offset <= kReach; ++offset) {
        const Eigen::Index shift = (middle + offset + sectors) % sectors;
        const double cosine = mean_cosine(image, scale, own, own_scale, shift);
        if (cosine > best.similarity) best = {cosine, shift};
      }
    }
    return best;
  }
};

}  // namespace
}  // namespace scan_context_pp

std::unique_ptr<Baseline> make_scan_context_pp() { return std::make_unique<scan_context_pp::ScanContextPlusPlus>(); }

}  // namespace revisit::descriptors_internal
