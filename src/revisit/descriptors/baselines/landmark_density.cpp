// SPDX-License-Identifier: Apache-2.0
// Cieslewski, Stumm, Gawel, Bosse, Lynen and Siegwart, "Point Cloud Descriptors for Place Recognition using Sparse
// Visual Information", ICRA 2016, NBLD (neighbour-binary landmark density): around a landmark, points are counted in
// the cells of an upright cylinder; whether a cell is denser than each of its neighbours are the bits. Made for sparse
// landmarks of cameras; here landmarks are the points of ten scans (each fifth is a place), one a voxel of 0.5 m,
// without the ground. What the abstract leaves open is chosen here: the 60 landmarks with the most in a column of 1 m
// are described, up to 40 m away; a cylinder is 12 m wide to each side, with 4 rings, 16 sectors and 4 layers of 2 m;
// sectors are counted from where the centre of mass of the cylinder lies; a query's landmark votes for a place by how
// near its nearest descriptor there is, as far as fewer than a quarter of the bits differ.
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <map>
#include <utility>
#include <vector>

#include <revisit/descriptors/internal/baselines.hpp>

namespace revisit::descriptors_internal {
namespace landmark_density {
namespace {

constexpr std::size_t kScans = 10, kPlaceEvery = 5, kLandmarks = 60;
constexpr int kRings = 4, kSectors = 16, kLayers = 4;
constexpr float kRadius_m = 12.f, kLayer_m = 2.f, kVoxel_m = 0.5f, kColumn_m = 1.f, kReach_m = 40.f,
                kAboveGround_m = 0.3f;
constexpr std::size_t kBits =
    std::size_t{kSectors} * (2 * kRings * kLayers + (kRings - 1) * kLayers + kRings * (kLayers - 1));
constexpr std::size_t kWords = (kBits + 63) / 64;
constexpr int kMostDifferent = static_cast<int>(kBits / 4);

std::vector<Eigen::Vector3f> landmarks_of(std::span<const Point> points, float ground_z_m) {
  std::map<std::array<int, 3>, Eigen::Vector3f> voxels;  // the first point of each
  for (const Point& p : points) {
    const float up_m = p.z - ground_z_m;
    if (!(std::hypot(p.x, p.y) < kReach_m + kRadius_m) || !(up_m > kAboveGround_m && up_m < kLayers * kLayer_m))
      continue;
    const auto cell = [](float metres) { return static_cast<int>(std::floor(metres / kVoxel_m)); };
    voxels.try_emplace({cell(p.x), cell(p.y), cell(p.z)}, p.x, p.y, up_m);
  }
  std::vector<Eigen::Vector3f> landmarks;
  landmarks.reserve(voxels.size());
  for (const auto& [cell, point] : voxels) landmarks.push_back(point);
  return landmarks;
}

// The means of the columns that hold most, as far as none beside them holds more.
std::vector<Eigen::Vector3f> described_of(const std::vector<Eigen::Vector3f>& landmarks) {
  struct Column {
    Eigen::Vector3f sum = Eigen::Vector3f::Zero();
    float count = 0.f;
  };
  std::map<std::pair<int, int>, Column> columns;
  for (const Eigen::Vector3f& point : landmarks) {
    if (point.head<2>().norm() >= kReach_m) continue;
    Column& column = columns[{static_cast<int>(std::floor(point.x() / kColumn_m)),
                              static_cast<int>(std::floor(point.y() / kColumn_m))}];
    column.sum += point;
    column.count += 1.f;
  }
  std::vector<std::pair<float, Eigen::Vector3f>> found;
  for (const auto& [cell, column] : columns) {
    bool is_most = true;
    for (int i = -1; i <= 1; ++i)
      for (int j = -1; j <= 1; ++j) {
        const auto other = columns.find({cell.first + i, cell.second + j});
        is_most = is_most && (other == columns.end() || other->second.count <= column.count);
      }
    if (is_most) found.emplace_back(column.count, column.sum / column.count);
  }
  std::stable_sort(found.begin(), found.end(), [](const auto& a, const auto& b) { return a.first > b.first; });
  std::vector<Eigen::Vector3f> described;
  for (std::size_t i = 0; i < std::min(kLandmarks, found.size()); ++i) described.push_back(found[i].second);
  return described;
}

using Densities = std::array<std::array<std::array<float, kSectors>, kRings>, kLayers>;

Densities densities_around(const Eigen::Vector3f& landmark, const std::vector<Eigen::Vector3f>& all) {
  std::vector<Eigen::Vector3f> inside;
  Eigen::Vector2f centre = Eigen::Vector2f::Zero();
  for (const Eigen::Vector3f& point : all) {
    const Eigen::Vector3f off(point.x() - landmark.x(), point.y() - landmark.y(), point.z());
    if (off.head<2>().norm() >= kRadius_m) continue;
    inside.push_back(off);
    centre += off.head<2>();
  }
  const float forward_rad = std::atan2(centre.y(), centre.x());
  Densities densities{};
  for (const Eigen::Vector3f& off : inside) {
    const float range_m = off.head<2>().norm();
    const double turn = wrap_angle(static_cast<double>(std::atan2(off.y(), off.x()) - forward_rad)) / (2.0 * kPi) + 0.5;
    const auto ring = static_cast<std::size_t>(range_m / kRadius_m * kRings);
    const auto sector = std::min(static_cast<std::size_t>(turn * kSectors), std::size_t{kSectors} - 1);
    densities[static_cast<std::size_t>(off.z() / kLayer_m)][ring][sector] += 1.f / static_cast<float>(2 * ring + 1);
  }
  return densities;
}

// Along the rings (to both sides of a sector), outwards, and upwards.
void add_bits(const Densities& densities, std::vector<std::uint64_t>& words) {
  const std::size_t first = words.size();
  words.resize(first + kWords);
  std::size_t bit = 0;
  const auto compare = [&](float a, float b) {
    if (a > b) words[first + bit / 64] |= std::uint64_t{1} << (bit % 64);
    ++bit;
  };
  for (std::size_t layer = 0; layer < kLayers; ++layer)
    for (std::size_t ring = 0; ring < kRings; ++ring)
      for (std::size_t sector = 0; sector < kSectors; ++sector) {
        const auto& own = densities[layer][ring];
        compare(own[sector], own[(sector + 1) % kSectors]);
        compare(own[(sector + 1) % kSectors], own[sector]);
        if (ring + 1 < kRings) compare(own[sector], densities[layer][ring + 1][sector]);
        if (layer + 1 < kLayers) compare(own[sector], densities[layer + 1][ring][sector]);
      }
}

class LandmarkDensity final : public Baseline {
 public:
  std::string name() const override { return "nbld"; }
  std::string source() const override { return "Cieslewski et al., ICRA 2016; of the last ten scans"; }
  std::size_t scans() const override { return kScans; }
  std::size_t place_every() const override { return kPlaceEvery; }

  // `bits`: a descriptor after the other.
  Signature describe(std::span<const Point> points, double ground_z_m) const override {
    const std::vector<Eigen::Vector3f> landmarks = landmarks_of(points, static_cast<float>(ground_z_m));
    Signature signature;
    for (const Eigen::Vector3f& landmark : described_of(landmarks))
      add_bits(densities_around(landmark, landmarks), signature.bits);
    return signature;
  }

  double similarity(const Signature& query, const Signature& place) const override {
    int votes = 0;
    for (std::size_t q = 0; q < query.bits.size(); q += kWords) {
      int least = kMostDifferent;
      for (std::size_t p = 0; p < place.bits.size(); p += kWords) {
        int different = 0;
        for (std::size_t w = 0; w < kWords; ++w) different += std::popcount(query.bits[q + w] ^ place.bits[p + w]);
        least = std::min(least, different);
      }
      votes += kMostDifferent - least;
    }
    return static_cast<double>(votes) / (static_cast<double>(kLandmarks) * kMostDifferent);
  }
};

}  // namespace
}  // namespace landmark_density

std::unique_ptr<Baseline> make_landmark_density() { return std::make_unique<landmark_density::LandmarkDensity>(); }

}  // namespace revisit::descriptors_internal
