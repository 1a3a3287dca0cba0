// SPDX-License-Identifier: Apache-2.0
// Jiang and Shen, "Contour Context: Abstract Structural Distribution for 3D LiDAR Loop Detection and Metric Pose
// Estimation", ICRA 2023: a view from above is cut at several heights; what hangs together is a contour, known by its
// centre, spread and size. The largest of each of three levels have a key (their size and spread, and how much stands
// at which distance around them), by which places are looked up; a constellation of contours around two that look alike
// must agree; then the contours are a mixture of Gaussians, whose correlation is optimised over the pose and is the
// score. The constellation's checks are one here: contours of like size at like distances whose bearings differ by the
// same angle; 50 places of nearest keys are compared.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <tuple>
#include <utility>
#include <vector>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include <revisit/core/planar_fit.hpp>
#include <revisit/descriptors/internal/baselines.hpp>
#include <revisit/descriptors/internal/contours.hpp>
#include <revisit/descriptors/internal/planar_mixture.hpp>

namespace revisit::descriptors_internal {
namespace contour_context {
namespace {

constexpr std::size_t kAnchorLevels = 3, kAnchors = 6, kNeighbours = 15, kOfMixture = 25, kPlacesCompared = 50;
constexpr std::size_t kAnchorPairs = 10, kFewestAgreeing = 4;
constexpr int kRings = 7, kKey = 3 + kRings;
constexpr float kAround_m = 10.f, kFewestAnchorCells = 9.f;
constexpr float kSameDistance_m = 1.f, kLeastDistance_m = 2.f, kFarthest_m = 40.f, kLikeSize = 0.6f;
const float kSameAngle_rad = static_cast<float>(kPi) / 16.f;

Eigen::Vector<float, kKey> key_of(const Contour& contour, const ContourMap& map) {
  Eigen::Vector<float, kKey> key = Eigen::Vector<float, kKey>::Zero();
  const Eigen::Vector2f spread =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix2f>(contour.covariance, Eigen::EigenvaluesOnly).eigenvalues();
  key.head<3>() << std::sqrt(spread[1]), std::sqrt(spread[0]), std::sqrt(contour.cells);
  const float level_m = kContourLevels_m[static_cast<std::size_t>(contour.level)];
  for (const ContourMap::Top& top : map.tops) {
    const float away_m = (top.position - contour.centre).norm();
    if (away_m >= kAround_m || top.height_m < level_m) continue;
    const float ring = away_m / kAround_m * kRings - 0.5f;
    for (int i = 0; i < kRings; ++i) {
      const float off = static_cast<float>(i) - ring;
      key[3 + i] += std::exp(-off * off / 2.f);
    }
  }
  key.tail<kRings>() = key.tail<kRings>().cwiseSqrt();
  return key;
}

// As columns: level, centre, covariance (xx, xy, yy), cells.
Eigen::Vector<float, 7> to_column(const Contour& c) {
  return {static_cast<float>(c.level), c.centre.x(),       c.centre.y(), c.covariance(0, 0),
          c.covariance(0, 1),          c.covariance(1, 1), c.cells};
}
Eigen::Vector2f centre_of(const Eigen::MatrixXf& contours, Eigen::Index i) { return contours.block<2, 1>(1, i); }
float cells_of(const Eigen::MatrixXf& contours, Eigen::Index i) { return contours(6, i); }
bool are_alike(const Eigen::MatrixXf& a, Eigen::Index i, const Eigen::MatrixXf& b, Eigen::Index j) {
  const auto [less, more] = std::minmax({cells_of(a, i), cells_of(b, j)});
  return a(0, i) == b(0, j) && less >= kLikeSize * more - 1.f;
}

// Keys by level: key, place.
class ContourIndex final : public BaselineIndex {
 public:
  void add(const Baseline::Signature& place) override {
    for (Eigen::Index i = 0; i < place.more.cols(); ++i) {
      Level& level = levels_[level_of(place, i)];
      level.keys.insert(level.keys.end(), place.more.col(i).data(), place.more.col(i).data() + kKey);
      level.places.push_back(places_);
    }
    ++places_;
  }

  std::vector<std::size_t> look_up(const Baseline::Signature& query, std::size_t searchable) const override {
    std::vector<float> nearest(searchable, std::numeric_limits<float>::infinity());
    for (Eigen::Index i = 0; i < query.more.cols(); ++i) {
      const Level& level = levels_[level_of(query, i)];
      const Eigen::Vector<float, kKey> key = query.more.col(i).head<kKey>();
      for (std::size_t k = 0; k < level.places.size() && level.places[k] < searchable; ++k) {
        float& best = nearest[level.places[k]];
        best =
            std::min(best, (Eigen::Map<const Eigen::Vector<float, kKey>>(&level.keys[k * kKey]) - key).squaredNorm());
      }
    }
    std::vector<std::size_t> places(searchable);
    std::iota(places.begin(), places.end(), std::size_t{0});
    const auto kept = static_cast<std::ptrdiff_t>(std::min(kPlacesCompared, searchable));
    std::partial_sort(places.begin(), places.begin() + kept, places.end(), [&](std::size_t a, std::size_t b) {
      return nearest[a] != nearest[b] ? nearest[a] < nearest[b] : a < b;
    });
    places.resize(static_cast<std::size_t>(kept));
    return places;
  }

  std::size_t bytes() const override { return 0; }  // the keys are counted with the signatures

 private:
  struct Level {
    std::vector<float> keys;
    std::vector<std::size_t> places;
  };
  static std::size_t level_of(const Baseline::Signature& signature, Eigen::Index key) {
    return static_cast<std::size_t>(signature.values(0, static_cast<Eigen::Index>(signature.more(kKey, key))));
  }
  std::array<Level, kAnchorLevels> levels_;
  std::size_t places_ = 0;
};

class ContourContext final : public Baseline {
 public:
  std::string name() const override { return "contour-context"; }
  std::string source() const override { return "Jiang and Shen, ICRA 2023"; }
  Gives gives() const override { return Gives::kPlanarPose; }

  // `values`: the contours; `more`: a key a column, and which contour it is of.
  Signature describe(std::span<const Point> points, double ground_z_m) const override {
    const ContourMap map = find_contours(points, static_cast<float>(ground_z_m));
    std::vector<Eigen::Vector<float, 7>> contours;
    std::vector<Eigen::Vector<float, kKey + 1>> keys;
    for (std::size_t level = 0; level < map.contours.size(); ++level)
      for (std::size_t i = 0; i < std::min(map.contours[level].size(), kOfMixture); ++i) {
        const Contour& contour = map.contours[level][i];
        if (level < kAnchorLevels && i < kAnchors && contour.cells >= kFewestAnchorCells)
          keys.emplace_back() << key_of(contour, map), static_cast<float>(contours.size());
        contours.push_back(to_column(contour));
      }
    Signature signature{Eigen::MatrixXf(7, static_cast<Eigen::Index>(contours.size())),
                        {},
                        Eigen::MatrixXf(kKey + 1, static_cast<Eigen::Index>(keys.size()))};
    for (std::size_t i = 0; i < contours.size(); ++i) signature.values.col(static_cast<Eigen::Index>(i)) = contours[i];
    for (std::size_t i = 0; i < keys.size(); ++i) signature.more.col(static_cast<Eigen::Index>(i)) = keys[i];
    return signature;
  }

  double least_similarity() const override { return 0.0; }
  double similarity(const Signature& query, const Signature& place) const override {
    const auto found = align(query, place);
    return found ? found->correlation : 0.0;
  }
  Pose T_place_query(const Signature& query, const Signature& place) const override {
    const auto found = align(query, place);
    return found ? found->T_target_source : Pose::Identity();
  }
  std::unique_ptr<BaselineIndex> make_index() const override { return std::make_unique<ContourIndex>(); }

 private:
  struct Neighbour {
    Eigen::Index contour;
    float distance_m, bearing_rad;
  };
  using Pairs = std::vector<std::pair<Eigen::Index, Eigen::Index>>;

  static std::vector<Neighbour> neighbours_of(const Eigen::MatrixXf& contours, Eigen::Index anchor) {
    std::vector<Neighbour> found;
    std::array<std::size_t, kContourLevels_m.size()> taken{};
    for (Eigen::Index i = 0; i < contours.cols(); ++i) {
      if (taken[static_cast<std::size_t>(contours(0, i))]++ >= kNeighbours) continue;
      const Eigen::Vector2f off = centre_of(contours, i) - centre_of(contours, anchor);
      if (off.norm() < kLeastDistance_m || off.norm() > kFarthest_m) continue;
      found.push_back({i, off.norm(), std::atan2(off.y(), off.x())});
    }
    return found;
  }

  // Most contours around the two that are alike, equally far, and turned by the same angle.
  static Pairs constellation(const Eigen::MatrixXf& query, Eigen::Index of_query, const Eigen::MatrixXf& place,
                             Eigen::Index of_place) {
    struct Agreeing {
      float turn_rad;
      Eigen::Index query, place;
    };
    std::vector<Agreeing> alike;
    const std::vector<Neighbour> around_place = neighbours_of(place, of_place);
    for (const Neighbour& a : neighbours_of(query, of_query))
      for (const Neighbour& b : around_place)
        if (std::abs(a.distance_m - b.distance_m) < kSameDistance_m && are_alike(query, a.contour, place, b.contour))
          alike.push_back({static_cast<float>(wrap_angle(static_cast<double>(b.bearing_rad - a.bearing_rad))),
                           a.contour, b.contour});
    std::sort(alike.begin(), alike.end(), [](const Agreeing& a, const Agreeing& b) {
      return std::tie(a.turn_rad, a.query, a.place) < std::tie(b.turn_rad, b.query, b.place);
    });
    std::size_t most = 0, first = 0;
    const auto turn_at = [&](std::size_t i) {
      return alike[i % alike.size()].turn_rad + (i < alike.size() ? 0.f : 2.f * static_cast<float>(kPi));
    };
    for (std::size_t begin = 0, end = 0; begin < alike.size(); ++begin) {
      end = std::max(end, begin);
      while (end < begin + alike.size() && turn_at(end) - turn_at(begin) <= kSameAngle_rad) ++end;
      if (end - begin > most) most = end - begin, first = begin;
    }
    Pairs pairs{{of_query, of_place}};
    for (std::size_t i = first; i < first + most; ++i) {
      const Agreeing& each = alike[i % alike.size()];
      if (std::none_of(pairs.begin(), pairs.end(),
                       [&](const auto& pair) { return pair.first == each.query || pair.second == each.place; }))
        pairs.emplace_back(each.query, each.place);
    }
    return pairs;
  }

  static Pose fitted(const Eigen::MatrixXf& query, const Eigen::MatrixXf& place, const Pairs& pairs) {
    Eigen::Matrix2Xf from(2, static_cast<Eigen::Index>(pairs.size())), to = from;
    Eigen::Index i = 0;
    for (const auto& [of_query, of_place] : pairs) {
      from.col(i) = centre_of(query, of_query);
      to.col(i++) = centre_of(place, of_place);
    }
    return planar_fit(from, to);
  }

  static std::optional<MixtureAlignment> align(const Signature& query, const Signature& place) {
    struct AnchorPair {
      float difference;
      Eigen::Index query, place;
    };
    std::vector<AnchorPair> anchors;
    for (Eigen::Index i = 0; i < query.more.cols(); ++i)
      for (Eigen::Index j = 0; j < place.more.cols(); ++j) {
        const auto a = static_cast<Eigen::Index>(query.more(kKey, i)),
                   b = static_cast<Eigen::Index>(place.more(kKey, j));
        if (are_alike(query.values, a, place.values, b))
          anchors.push_back({(query.more.col(i).head<kKey>() - place.more.col(j).head<kKey>()).squaredNorm(), a, b});
      }
    const std::size_t tried = std::min(kAnchorPairs, anchors.size());
    std::partial_sort(anchors.begin(), anchors.begin() + static_cast<std::ptrdiff_t>(tried), anchors.end(),
                      [](const AnchorPair& a, const AnchorPair& b) { return a.difference < b.difference; });
    Pairs best;
    for (std::size_t i = 0; i < tried; ++i)
      if (Pairs pairs = constellation(query.values, anchors[i].query, place.values, anchors[i].place);
          pairs.size() > best.size())
        best = std::move(pairs);
    if (best.size() < kFewestAgreeing) return std::nullopt;
    return align_mixtures(query.values, place.values, fitted(query.values, place.values, best));
  }
};

}  // namespace
}  // namespace contour_context

std::unique_ptr<Baseline> make_contour_context() { return std::make_unique<contour_context::ContourContext>(); }

}  // namespace revisit::descriptors_internal
