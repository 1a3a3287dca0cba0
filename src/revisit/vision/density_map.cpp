// SPDX-License-Identifier: Apache-2.0
// Gupta, Guadagnino, Mersch, Vizzo and Stachniss, "Effectively Detecting Loop Closures using Point Cloud Density Maps",
// ICRA 2024 (MapClosures): the scans of a while are put together and seen from above, each cell of 0.5 m as bright as
// it holds points, of which the faintest twentieth is black; ORB features of two such pictures are matched within 50
// bits, and most of them brought together by RANSAC in the plane (3 cells). Local maps are the last 50 scans here (in
// the paper: of 100 m), thinned to 0.25 m, and each tenth is a place to match with; matching is by brute force instead
// of a tree. The ground is taken to be level.
#include <algorithm>
#include <cmath>
#include <random>
#include <utility>
#include <vector>

#include <revisit/core/planar_fit.hpp>
#include <revisit/vision/density_map.hpp>
#include <revisit/vision/image_features.hpp>

namespace revisit {
namespace {

constexpr std::size_t kScans = 50, kPlaceEvery = 10, kFewestInliers = 6;
constexpr int kCells = 320, kMostDifferent = 50, kTries = 200;
constexpr float kCell_m = 0.5f, kReach_m = kCells * kCell_m / 2.f, kFaintest = 0.05f, kSame_m = 3.f * kCell_m;
constexpr FeatureOptions kDensityFeatures{300, 1, 35};

Image density_of(std::span<const Point> points) {
  std::vector<float> counts(std::size_t{kCells} * kCells);
  for (const Point& p : points) {
    if (!(std::abs(p.x) < kReach_m) || !(std::abs(p.y) < kReach_m)) continue;
    const auto cell = [](float metres) {
      return static_cast<std::size_t>(std::min(static_cast<int>((metres + kReach_m) / kCell_m), kCells - 1));
    };
    counts[cell(p.y) * kCells + cell(p.x)] += 1.f;
  }
  const float most = std::max(1.f, *std::max_element(counts.begin(), counts.end()));
  Image image{kCells, kCells, {}};
  for (const float count : counts)
    image.grey.push_back(static_cast<std::uint8_t>(count < kFaintest * most ? 0.f : 255.f * count / most));
  return image;
}

class DensityMap final : public Baseline {
 public:
  std::string name() const override { return "mapclosures"; }
  std::string source() const override { return "Gupta et al., ICRA 2024; of the last fifty scans"; }
  Gives gives() const override { return Gives::kPlanarPose; }
  std::size_t scans() const override { return kScans; }
  std::size_t place_every() const override { return kPlaceEvery; }
  double least_similarity() const override { return 0.0; }

  // `values`: where the features are, in metres; `bits`: four words each.
  Signature describe(std::span<const Point> points, double) const override {
    const std::vector<BinaryFeature> features = find_features(density_of(points), kDensityFeatures);
    Signature signature;
    signature.values.resize(2, static_cast<Eigen::Index>(features.size()));
    for (std::size_t i = 0; i < features.size(); ++i) {
      signature.values.col(static_cast<Eigen::Index>(i)) << (features[i].column + 0.5f) * kCell_m - kReach_m,
          (features[i].row + 0.5f) * kCell_m - kReach_m;
      signature.bits.insert(signature.bits.end(), features[i].bits.begin(), features[i].bits.end());
    }
    return signature;
  }

  double similarity(const Signature& query, const Signature& place) const override {
    const auto inliers = static_cast<double>(align(query, place).inliers);
    return inliers < static_cast<double>(kFewestInliers) ? 0.0 : inliers;
  }
  Pose T_place_query(const Signature& query, const Signature& place) const override {
    return align(query, place).T_place_query;
  }

 private:
  using Pairs = std::vector<std::pair<Eigen::Index, Eigen::Index>>;
  struct Alignment {
    std::size_t inliers = 0;
    Pose T_place_query = Pose::Identity();
  };

  static BinaryFeature::Bits bits_of(const Signature& signature, Eigen::Index i) {
    BinaryFeature::Bits bits;
    std::copy_n(signature.bits.begin() + 4 * i, 4, bits.begin());
    return bits;
  }

  static Pairs matches(const Signature& query, const Signature& place) {
    Pairs pairs;
    for (Eigen::Index q = 0; q < query.values.cols(); ++q) {
      const BinaryFeature::Bits bits = bits_of(query, q);
      int least = kMostDifferent + 1;
      Eigen::Index nearest = 0;
      for (Eigen::Index p = 0; p < place.values.cols(); ++p)
        if (const int different = hamming(bits, bits_of(place, p)); different < least) least = different, nearest = p;
      if (least <= kMostDifferent) pairs.emplace_back(q, nearest);
    }
    return pairs;
  }

  static Pose fitted(const Signature& query, const Signature& place, const Pairs& pairs) {
    Eigen::Matrix2Xf from(2, static_cast<Eigen::Index>(pairs.size())), to = from;
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      from.col(static_cast<Eigen::Index>(i)) = query.values.col(pairs[i].first);
      to.col(static_cast<Eigen::Index>(i)) = place.values.col(pairs[i].second);
    }
    return planar_fit(from, to);
  }

  static Pairs brought_together(const Signature& query, const Signature& place, const Pairs& pairs, const Pose& T) {
    const Eigen::Matrix2f R = T.linear().topLeftCorner<2, 2>().cast<float>();
    const Eigen::Vector2f t = T.translation().head<2>().cast<float>();
    Pairs together;
    for (const auto& pair : pairs)
      if ((R * query.values.col(pair.first) + t - place.values.col(pair.second)).norm() < kSame_m)
        together.push_back(pair);
    return together;
  }

  static Alignment align(const Signature& query, const Signature& place) {
    const Pairs pairs = matches(query, place);
    if (pairs.size() < kFewestInliers) return {};
    std::mt19937 random(1);
    Pairs best;
    for (int i = 0; i < kTries; ++i) {
      const Pairs two{pairs[random() % pairs.size()], pairs[random() % pairs.size()]};
      if (two[0].first == two[1].first) continue;
      Pairs together = brought_together(query, place, pairs, fitted(query, place, two));
      if (together.size() > best.size()) best = std::move(together);
    }
    return {best.size(), fitted(query, place, best)};
  }
};

}  // namespace

std::unique_ptr<Baseline> make_density_map() { return std::make_unique<DensityMap>(); }

}  // namespace revisit
