// SPDX-License-Identifier: Apache-2.0
#include <revisit/odometry/local_map.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <tsl/robin_map.h>
#include <Eigen/Eigenvalues>

namespace revisit {
namespace {

using Index = Eigen::Vector3i;

struct IndexHash {
  // Teschner et al., "Optimized Spatial Hashing for Collision Detection of Deformable Objects", 2003.
  std::size_t operator()(const Index& v) const {
    const auto u = v.cast<std::uint32_t>();
    return (u.x() * 73856093u) ^ (u.y() * 19349669u) ^ (u.z() * 83492791u);
  }
};

struct Planes {
  static constexpr std::uint32_t kFewest = 5;  ///< points
  static constexpr float kFlat = 0.1f;         ///< least over middle spread, at most
  static constexpr float kWide = 0.02f;        ///< middle over largest spread, at least: a line has no normal
  static constexpr float kGuess = 0.1f;        ///< thickness, in voxels, that few points are taken to have,
  static constexpr float kGuesses = 2.f;       ///< as if so many points had said so
  static constexpr std::uint32_t kMost = 100;  ///< points a voxel; more say nothing new
};

// Sums over points, taken from a place near them so that floats suffice.
struct Sums {
  void archive(auto& fields) { fields(origin, first, second, count); }

  Eigen::Vector3f origin = Eigen::Vector3f::Zero(), first = Eigen::Vector3f::Zero();
  Eigen::Matrix3f second = Eigen::Matrix3f::Zero();
  std::uint32_t count = 0;

  void add(const Eigen::Vector3f& p) {
    if (count == 0) origin = p;
    const Eigen::Vector3f d = p - origin;
    first += d;
    second.noalias() += d * d.transpose();
    ++count;
  }
  void add(const Sums& other) {
    const Eigen::Vector3f d = other.origin - origin;
    const auto n = static_cast<float>(other.count);
    second += other.second + other.first * d.transpose() + d * other.first.transpose() + n * d * d.transpose();
    first += other.first + n * d;
    count += other.count;
  }
  Eigen::Vector3f mean() const { return origin + first / static_cast<float>(count); }

  // The plane that the points lie on, if they do, becomes the patch's.
  void find_plane(Surface::Patch& patch, float voxel_m) const {
    if (count < Planes::kFewest) return;
    const Eigen::Vector3f centre = first / static_cast<float>(count);
    const Eigen::Matrix3f covariance = second / static_cast<float>(count) - centre * centre.transpose();
    Eigen::SelfAdjointEigenSolver<Eigen::Matrix3f> solver;
    solver.computeDirect(covariance);
    const Eigen::Vector3f spread = solver.eigenvalues();
    if (spread[0] > Planes::kFlat * spread[1] || spread[1] < Planes::kWide * spread[2]) return;
    patch.normal = solver.eigenvectors().col(0);
    // How far from the plane surfaces are: across it as the points lie, of which a plane's three parameters hide some,
    // and a voxel away by the tilt, too, in which points along a line leave it.
    const auto n = static_cast<float>(count);
    const float guess_m = Planes::kGuess * voxel_m;
    const float across_m2 =
        (n * std::max(spread[0], 0.f) + Planes::kGuesses * guess_m * guess_m) / (n - 3.f + Planes::kGuesses);
    patch.variance_m2 = across_m2 * (1.f + voxel_m * voxel_m / (n * spread[1]));
  }
};

struct Voxel {
  Sums sums;
  Surface::Patch patch;
  bool is_stale = false;  ///< points were added since the patch was found

  void archive(auto& fields) { fields(sums, patch); }
};

}  // namespace

struct LocalMap::Voxels {
  tsl::robin_map<Index, Voxel, IndexHash> map;
  std::vector<Index> stale;

  // The surface within a voxel; where its points lie on none, the one that its neighbours' points lie on with them:
  // the lines of a sparse sensor are a voxel apart.
  void find_surface(const Index& index, float voxel_m) {
    Voxel& voxel = map.find(index).value();
    voxel.is_stale = false;
    voxel.patch = {.point = voxel.sums.mean()};
    voxel.sums.find_plane(voxel.patch, voxel_m);
    if (!voxel.patch.normal.isZero()) return;
    Sums around = voxel.sums;
    for (int k = 0; k < 27; ++k) {
      const Index step(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1);
      if (step.isZero()) continue;
      if (const auto found = map.find(index + step); found != map.end()) around.add(found->second.sums);
    }
    around.find_plane(voxel.patch, voxel_m);
  }
};

LocalMap::LocalMap(double voxel_m, double reach_m)
    : voxel_m_(static_cast<float>(voxel_m)),
      reach_m_(static_cast<float>(reach_m)),
      voxels_(std::make_unique<Voxels>()) {
  if (!(voxel_m > 0.0) || !(reach_m > 0.0))
    throw std::invalid_argument("a map of voxels of " + std::to_string(voxel_m) + " m up to " +
                                std::to_string(reach_m) + " m; allowed: both above 0");
}

LocalMap::~LocalMap() = default;
LocalMap::LocalMap(LocalMap&&) noexcept = default;
LocalMap& LocalMap::operator=(LocalMap&&) noexcept = default;

void LocalMap::archive(StateWriter& fields) {
  std::vector<std::pair<Index, Voxel>> entries(voxels_->map.begin(), voxels_->map.end());
  fields(voxel_m_, reach_m_, entries);
}

void LocalMap::archive(StateReader& fields) {
  std::vector<std::pair<Index, Voxel>> entries;
  fields(voxel_m_, reach_m_, entries);
  fields.require(voxel_m_ > 0.f && reach_m_ > 0.f);
  *voxels_ = {};
  for (const auto& [index, voxel] : entries) {
    fields.require(voxel.sums.count > 0);
    voxels_->map[index] = voxel;
  }
}

std::size_t LocalMap::voxels() const { return voxels_->map.size(); }

void LocalMap::add(std::span<const Eigen::Vector3f> points) {
  auto& stale = voxels_->stale;
  stale.clear();
  for (const Eigen::Vector3f& p : points) {
    const Index index = (p / voxel_m_).array().floor().cast<int>();
    Voxel& voxel = voxels_->map[index];
    if (voxel.sums.count >= Planes::kMost) continue;
    voxel.sums.add(p);
    if (!voxel.is_stale) stale.push_back(index);
    voxel.is_stale = true;
  }
  for (const Index& index : stale) voxels_->find_surface(index, voxel_m_);
}

void LocalMap::forget_far_from(const Eigen::Vector3f& centre) {
  auto& map = voxels_->map;
  for (auto it = map.begin(); it != map.end();)
    it = (it->second.sums.origin - centre).squaredNorm() > reach_m_ * reach_m_ ? map.erase(it) : std::next(it);
}

bool LocalMap::nearest_patch(const Eigen::Vector3f& query, float squared_reach_m2, Patch& patch) const {
  // Of each axis, the voxel of the query and its neighbour on the nearer side, which is so far away.
  const Eigen::Vector3f cells = query / voxel_m_;
  const Eigen::Vector3f own = cells.array().floor(), within = cells - own;
  const Index voxel = own.cast<int>();
  Index side;
  Eigen::Vector3f gap2;
  for (int axis = 0; axis < 3; ++axis) {
    const bool is_above = within[axis] >= 0.5f;
    side[axis] = is_above ? 1 : -1;
    const float gap_m = voxel_m_ * (is_above ? 1.f - within[axis] : within[axis]);
    gap2[axis] = gap_m * gap_m;
  }
  const Voxel* best = nullptr;
  for (int corner = 0; corner < 8; ++corner) {
    const Index step(corner & 1, corner >> 1 & 1, corner >> 2);
    // Nothing in that voxel is nearer than its border.
    if (step.cast<float>().dot(gap2) >= squared_reach_m2) continue;
    const auto found = voxels_->map.find(voxel + step.cwiseProduct(side));
    if (found == voxels_->map.end() || found->second.patch.normal.isZero()) continue;
    const float d2 = (found->second.patch.point - query).squaredNorm();
    if (d2 >= squared_reach_m2) continue;
    squared_reach_m2 = d2;
    best = &found->second;
  }
  if (best == nullptr) return false;
  patch = best->patch;
  return true;
}

}  // namespace revisit
