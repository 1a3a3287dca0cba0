// SPDX-License-Identifier: Apache-2.0
#include <revisit/descriptors/internal/triangles.hpp>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <numeric>
#include <set>
#include <unordered_map>
#include <utility>

#include <Eigen/Geometry>
#include <Eigen/SVD>

namespace revisit::descriptors_internal {
namespace {

using Signature = Baseline::Signature;

constexpr float kShortest_m = 2.f, kSame = 0.01f;  // of the length of the three sides together
constexpr float kUpright = 0.7f;                   // the z of its normal is less where a piece is no ground
constexpr float kSameNormals = 0.3f, kSameCodes = 0.7f;
constexpr std::size_t kPosesTried = 50, kFewestMatches = 4;
constexpr float kSameVertex_m = 1.f, kSamePlane_m = 0.5f, kNearPlane_m = 3.f, kSameDirection = 0.2f;

std::vector<std::size_t> nearest_of(const std::vector<TriangleKeypoint>& keypoints, std::size_t of, std::size_t count) {
  std::vector<std::size_t> others(keypoints.size());
  std::iota(others.begin(), others.end(), std::size_t{0});
  std::erase(others, of);
  const auto distance = [&](std::size_t i) { return (keypoints[i].position - keypoints[of].position).squaredNorm(); };
  const auto kept = static_cast<std::ptrdiff_t>(std::min(count, others.size()));
  std::partial_sort(others.begin(), others.begin() + kept, others.end(), [&](std::size_t a, std::size_t b) {
    return std::pair(distance(a), a) < std::pair(distance(b), b);
  });
  others.resize(static_cast<std::size_t>(kept));
  return others;
}

Eigen::Vector<float, 9> triangle_of(const std::vector<TriangleKeypoint>& keypoints,
                                    const std::array<std::size_t, 3>& corners) {
  std::array<std::pair<float, std::size_t>, 3> sides;  // and what lies opposite
  for (std::size_t i = 0; i < 3; ++i)
    sides[i] = {(keypoints[corners[(i + 1) % 3]].position - keypoints[corners[(i + 2) % 3]].position).norm(),
                corners[i]};
  std::sort(sides.begin(), sides.end());
  Eigen::Vector<float, 9> triangle;
  for (std::size_t i = 0; i < 3; ++i) {
    triangle[static_cast<Eigen::Index>(i)] = sides[i].first;

    triangle[static_cast<Eigen::Index>(i + 3)] = static_cast<float>(sides[i].second);
    triangle[static_cast<Eigen::Index>(i + 6)] =
        keypoints[sides[i].second].normal.dot(keypoints[sides[(i + 1) % 3].second].normal);
  }
  return triangle;
}

Eigen::Index keypoint_of(const Signature& signature, Eigen::Index triangle, Eigen::Index corner) {
  return static_cast<Eigen::Index>(signature.values(3 + corner, triangle));
}
Eigen::Vector3f position_of(const Signature& signature, Eigen::Index triangle, Eigen::Index corner) {
  return signature.more.block<3, 1>(0, keypoint_of(signature, triangle, corner));
}

float alike(std::uint64_t a, std::uint64_t b) {
  const int sum = std::popcount(a) + std::popcount(b);
  return sum == 0 ? 1.f : 2.f * static_cast<float>(std::popcount(a & b)) / static_cast<float>(sum);
}

// Angles between the normals do not change with the pose; neither do the codes.
bool normals_agree(const Eigen::Vector3f& a, const Eigen::Vector3f& b) {
  return (a - b).cwiseAbs().maxCoeff() <= kSameNormals;
}
bool codes_agree(const Signature& query, Eigen::Index q, const Signature& place, Eigen::Index p) {
  float codes = 0.f;
  for (Eigen::Index corner = 0; corner < 3; ++corner)
    codes += alike(query.bits[static_cast<std::size_t>(keypoint_of(query, q, corner))],
                   place.bits[static_cast<std::size_t>(keypoint_of(place, p, corner))]);
  return codes >= 3.f * kSameCodes;
}
Eigen::Vector3f cosines_of(const Signature& signature, Eigen::Index triangle) {
  return signature.values.block<3, 1>(6, triangle);
}

float tolerance_m(const Eigen::Vector3f& sides) { return kSame * sides.norm(); }

using Pairs = std::vector<std::pair<Eigen::Index, Eigen::Index>>;

Pairs agreeing_triangles(const Signature& query, const Signature& place) {
  Pairs pairs;
  Eigen::Index first = 0;
  for (Eigen::Index q = 0; q < query.values.cols(); ++q) {
    const Eigen::Vector3f sides = query.values.block<3, 1>(0, q);
    const float most_m = tolerance_m(sides);
    // Both in the order of the longest side, with which the tolerance grows by less.
    while (first < place.values.cols() && place.values(2, first) < sides[2] * (1.f - kSame * std::sqrt(3.f))) ++first;
    for (Eigen::Index p = first; p < place.values.cols() && place.values(2, p) <= sides[2] + most_m; ++p)
      if ((place.values.block<3, 1>(0, p) - sides).squaredNorm() < most_m * most_m &&
          normals_agree(cosines_of(query, q), cosines_of(place, p)) && codes_agree(query, q, place, p))
        pairs.emplace_back(q, p);
  }
  return pairs;
}

// Least squares over their corners (Kabsch).
Eigen::Isometry3f pose_of(const Signature& query, const Signature& place, std::span<const Pairs::value_type> pairs) {
  Eigen::Vector3f mean_query = Eigen::Vector3f::Zero(), mean_place = Eigen::Vector3f::Zero();
  Eigen::Matrix3f products = Eigen::Matrix3f::Zero();
  for (const auto& [q, p] : pairs)
    for (Eigen::Index corner = 0; corner < 3; ++corner) {
      mean_query += position_of(query, q, corner);
      mean_place += position_of(place, p, corner);
      products += position_of(query, q, corner) * position_of(place, p, corner).transpose();
    }
  const auto count = static_cast<float>(3 * pairs.size());
  products -= mean_query * mean_place.transpose() / count;
  const Eigen::JacobiSVD<Eigen::Matrix3f> svd(products, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3f V = svd.matrixV();
  if ((V * svd.matrixU().transpose()).determinant() < 0.f) V.col(2) *= -1.f;
  Eigen::Isometry3f T = Eigen::Isometry3f::Identity();
  T.linear() = V * svd.matrixU().transpose();
  T.translation() = (mean_place - T.linear() * mean_query) / count;
  return T;
}

Pairs brought_together(const Signature& query, const Signature& place, const Pairs& pairs, const Eigen::Isometry3f& T) {
  Pairs together;
  for (const auto& [q, p] : pairs) {
    bool all = true;
    for (Eigen::Index corner = 0; corner < 3 && all; ++corner)
      all = (T * position_of(query, q, corner) - position_of(place, p, corner)).norm() < kSameVertex_m;
    if (all) together.emplace_back(q, p);
  }
  return together;
}

double share_of_planes(const Signature& query, const Signature& place, const Eigen::Isometry3f& T) {
  const auto first = static_cast<Eigen::Index>(query.bits.size()),
             of_place = static_cast<Eigen::Index>(place.bits.size());
  std::size_t met = 0;
  for (Eigen::Index i = first; i < query.more.cols(); ++i) {
    const Eigen::Vector3f centre = T * Eigen::Vector3f(query.more.block<3, 1>(0, i));
    const Eigen::Vector3f normal = T.linear() * query.more.block<3, 1>(3, i);
    for (Eigen::Index j = of_place; j < place.more.cols(); ++j) {
      const Eigen::Vector3f off = centre - place.more.block<3, 1>(0, j);
      if (off.squaredNorm() > kNearPlane_m * kNearPlane_m) continue;
      const Eigen::Vector3f other = place.more.block<3, 1>(3, j);
      if (std::abs(normal.dot(other)) < 1.f - kSameDirection * kSameDirection / 2.f ||
          std::abs(off.dot(other)) > kSamePlane_m)
        continue;
      ++met;
      break;
    }
  }
  const Eigen::Index planes = query.more.cols() - first;
  return planes == 0 ? 0.0 : static_cast<double>(met) / static_cast<double>(planes);
}

// Triangles by their sides, in cells of 0.2 m.
class TriangleIndex final : public BaselineIndex {
 public:
  void add(const Signature& place) override {
    for (Eigen::Index i = 0; i < place.values.cols(); ++i) {
      const Eigen::Vector3f sides = place.values.block<3, 1>(0, i);
      cells_[key_of((sides.array() / kCell_m).floor())].push_back(
          {sides, cosines_of(place, i), static_cast<std::uint32_t>(places_.size()), static_cast<std::uint32_t>(i)});
    }
    entries_ += static_cast<std::size_t>(place.values.cols());
    places_.push_back(&place);
  }

  std::vector<std::size_t> look_up(const Signature& query, std::size_t searchable) const override {
    std::vector<std::uint32_t> votes(searchable);
    for (Eigen::Index i = 0; i < query.values.cols(); ++i) {
      const Eigen::Vector3f sides = query.values.block<3, 1>(0, i);
      // Of the cells beside its own, those that the tolerance reaches.
      const float reach_m = std::min(tolerance_m(sides), kCell_m);
      const Eigen::Array3f lowest = ((sides.array() - reach_m).max(0.f) / kCell_m).floor();
      const Eigen::Array3f highest = ((sides.array() + reach_m) / kCell_m).floor();
      Eigen::Array3f cell;
      for (cell[0] = lowest[0]; cell[0] <= highest[0]; ++cell[0])
        for (cell[1] = lowest[1]; cell[1] <= highest[1]; ++cell[1])
          for (cell[2] = lowest[2]; cell[2] <= highest[2]; ++cell[2]) vote(query, i, sides, key_of(cell), votes);
    }
    std::vector<std::size_t> places;
    for (std::size_t i = 0; i < searchable; ++i)
      if (votes[i] >= kFewestMatches) places.push_back(i);
    const std::size_t kept = std::min(kCandidates, places.size());
    std::partial_sort(places.begin(), places.begin() + static_cast<std::ptrdiff_t>(kept), places.end(),
                      [&](std::size_t a, std::size_t b) { return votes[a] != votes[b] ? votes[a] > votes[b] : a < b; });
    places.resize(kept);
    return places;
  }

  std::size_t bytes() const override { return entries_ * sizeof(Entry); }

 private:
  static constexpr float kCell_m = 0.2f;
  static constexpr std::size_t kCandidates = 50;
  struct Entry {
    Eigen::Vector3f sides, cosines;
    std::uint32_t place, triangle;
  };

  static std::uint64_t key_of(const Eigen::Array3f& cell) {
    return static_cast<std::uint64_t>(cell[0]) << 40 | static_cast<std::uint64_t>(cell[1]) << 20 |
           static_cast<std::uint64_t>(cell[2]);
  }

  void vote(const Signature& query, Eigen::Index triangle, const Eigen::Vector3f& sides, std::uint64_t cell,
            std::vector<std::uint32_t>& votes) const {
    const auto found = cells_.find(cell);
    if (found == cells_.end()) return;
    const Eigen::Vector3f cosines = cosines_of(query, triangle);
    const float most_m2 = tolerance_m(sides) * tolerance_m(sides);
    for (const Entry& entry : found->second) {
      if (entry.place >= votes.size()) break;  // they come in order
      if ((entry.sides - sides).squaredNorm() < most_m2 && normals_agree(entry.cosines, cosines) &&
          codes_agree(query, triangle, *places_[entry.place], static_cast<Eigen::Index>(entry.triangle)))
        ++votes[entry.place];
    }
  }

  std::unordered_map<std::uint64_t, std::vector<Entry>> cells_;
  std::vector<const Signature*> places_;
  std::size_t entries_ = 0;
};

struct TriangleMatch {
  double similarity = 0.0;
  Pose T_place_query = Pose::Identity();
};

TriangleMatch match_triangles(const Signature& query, const Signature& place) {
  const Pairs pairs = agreeing_triangles(query, place);
  Pairs best;
  const std::size_t step = pairs.size() / kPosesTried + 1;
  for (std::size_t i = 0; i < pairs.size(); i += step) {
    Pairs together = brought_together(query, place, pairs, pose_of(query, place, std::span(&pairs[i], 1)));
    if (together.size() > best.size()) best = std::move(together);
  }
  if (best.size() < kFewestMatches) return {};
  const Eigen::Isometry3f T = pose_of(query, place, best);
  Pose T_place_query(T.matrix().cast<double>());
  return {share_of_planes(query, place, T), normalised(T_place_query)};
}

}  // namespace

Signature triangle_signature(const std::vector<TriangleKeypoint>& keypoints, std::span<const SurfaceVoxel> voxels,
                             const TriangleOptions& options) {
  std::set<std::array<std::size_t, 3>> corners;
  for (std::size_t i = 0; i < keypoints.size(); ++i) {
    const std::vector<std::size_t> near = nearest_of(keypoints, i, options.neighbours);
    for (std::size_t a = 0; a < near.size(); ++a)
      for (std::size_t b = a + 1; b < near.size(); ++b) {
        std::array<std::size_t, 3> triangle{i, near[a], near[b]};
        std::sort(triangle.begin(), triangle.end());
        corners.insert(triangle);
      }
  }
  std::vector<Eigen::Vector<float, 9>> triangles;
  for (const auto& each : corners)
    if (const auto triangle = triangle_of(keypoints, each);
        triangle[0] > kShortest_m && triangle[2] < options.longest_m)
      triangles.push_back(triangle);
  std::stable_sort(triangles.begin(), triangles.end(), [](const auto& a, const auto& b) { return a[2] < b[2]; });
  Signature signature;
  signature.values.resize(9, static_cast<Eigen::Index>(triangles.size()));
  for (std::size_t i = 0; i < triangles.size(); ++i) signature.values.col(static_cast<Eigen::Index>(i)) = triangles[i];
  // The ground agrees everywhere.
  const auto counts = [](const SurfaceVoxel& voxel) {
    return voxel.is_flat() && std::abs(voxel.normal.z()) < kUpright;
  };
  const auto flat = std::count_if(voxels.begin(), voxels.end(), counts);
  signature.more.resize(6, static_cast<Eigen::Index>(keypoints.size()) + flat);
  Eigen::Index column = 0;
  for (const TriangleKeypoint& keypoint : keypoints) {
    signature.more.col(column++) << keypoint.position, keypoint.normal;
    signature.bits.push_back(keypoint.code);
  }
  for (const SurfaceVoxel& voxel : voxels)
    if (counts(voxel)) signature.more.col(column++) << voxel.centre, voxel.normal;
  return signature;
}

double TriangleMethod::similarity(const Signature& query, const Signature& place) const {
  return match_triangles(query, place).similarity;
}
Pose TriangleMethod::T_place_query(const Signature& query, const Signature& place) const {
  return match_triangles(query, place).T_place_query;
}
std::unique_ptr<BaselineIndex> TriangleMethod::make_index() const { return std::make_unique<TriangleIndex>(); }

}  // namespace revisit::descriptors_internal
