// SPDX-License-Identifier: Apache-2.0
#include <revisit/registration/surface_cloud.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Eigenvalues>
#include <nanoflann.hpp>

namespace revisit {

ThinCloud thin(std::span<const Point> points, std::span<const std::uint8_t> is_ground, double voxel_m) {
  struct Entry {
    std::uint64_t voxel;
    std::uint32_t point;
  };
  std::vector<Entry> entries;
  entries.reserve(points.size());
  const double per_m = 1.0 / voxel_m;
  constexpr std::int64_t kOffset = 1 << 20, kLargest = (1 << 21) - 1;
  const auto index = [&](float metres) {
    const auto cell = static_cast<std::int64_t>(std::floor(metres * per_m)) + kOffset;
    return static_cast<std::uint64_t>(std::clamp<std::int64_t>(cell, 0, kLargest));
  };
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Point& p = points[i];
    entries.push_back({index(p.x) << 42 | index(p.y) << 21 | index(p.z), static_cast<std::uint32_t>(i)});
  }
  std::sort(entries.begin(), entries.end(),
            [](const Entry& a, const Entry& b) { return a.voxel != b.voxel ? a.voxel < b.voxel : a.point < b.point; });
  ThinCloud cloud;
  for (std::size_t begin = 0, end = 0; begin < entries.size(); begin = end) {
    Eigen::Vector3f sum = Eigen::Vector3f::Zero();
    std::size_t ground = 0;
    for (end = begin; end < entries.size() && entries[end].voxel == entries[begin].voxel; ++end) {
      const Point& p = points[entries[end].point];
      sum += Eigen::Vector3f(p.x, p.y, p.z);
      if (!is_ground.empty()) ground += is_ground[entries[end].point];
    }
    cloud.points.push_back(sum / static_cast<float>(end - begin));
    cloud.is_ground.push_back(2 * ground > end - begin);
  }
  return cloud;
}

struct SurfaceCloud::Tree {
  const std::vector<Eigen::Vector3f>* points;
  std::size_t kdtree_get_point_count() const { return points->size(); }
  float kdtree_get_pt(std::size_t i, std::size_t axis) const { return (*points)[i][static_cast<Eigen::Index>(axis)]; }
  template <typename Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
  using Index = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, Tree>, Tree, 3, std::uint32_t>;
  std::unique_ptr<Index> index;
};

SurfaceCloud::SurfaceCloud(ThinCloud cloud) : cloud_(std::move(cloud)), tree_(std::make_unique<Tree>()) {
  if (cloud_.is_ground.size() != cloud_.points.size()) cloud_.is_ground.assign(cloud_.points.size(), 0);
  // The tree points into this object's cloud, whose buffer stays in place when the object is moved.
  tree_->points = &cloud_.points;
  normals_.assign(cloud_.points.size(), Eigen::Vector3f::Zero());
  if (cloud_.points.empty()) return;
  tree_->index = std::make_unique<Tree::Index>(3, *tree_, nanoflann::KDTreeSingleIndexAdaptorParams(10));
  constexpr std::size_t kNeighbours = 10, kFewest = 5;
  for (std::size_t i = 0; i < cloud_.points.size(); ++i) {
    const auto neighbours = nearest(cloud_.points[i], kNeighbours);
    if (neighbours.size() < kFewest) continue;
    Eigen::Vector3f mean = Eigen::Vector3f::Zero();
    for (const auto& each : neighbours) mean += cloud_.points[each.index];
    mean /= static_cast<float>(neighbours.size());
    Eigen::Matrix3f covariance = Eigen::Matrix3f::Zero();
    for (const auto& each : neighbours) {
      const Eigen::Vector3f d = cloud_.points[each.index] - mean;
      covariance += d * d.transpose();
    }
    Eigen::SelfAdjointEigenSolver<Eigen::Matrix3f> solver;
    solver.computeDirect(covariance);
    normals_[i] = solver.eigenvectors().col(0);
  }
}

SurfaceCloud::~SurfaceCloud() = default;

SurfaceCloud::SurfaceCloud(SurfaceCloud&& other) noexcept
    : cloud_(std::move(other.cloud_)), normals_(std::move(other.normals_)), tree_(std::move(other.tree_)) {
  if (tree_) tree_->points = &cloud_.points;
}

SurfaceCloud& SurfaceCloud::operator=(SurfaceCloud&& other) noexcept {
  cloud_ = std::move(other.cloud_);
  normals_ = std::move(other.normals_);
  tree_ = std::move(other.tree_);
  if (tree_) tree_->points = &cloud_.points;
  return *this;
}

namespace {

// What nanoflann asks of a result set: the nearest point within a reach, which spares it all boxes farther away.
class NearestWithin {
 public:
  using DistanceType = float;
  explicit NearestWithin(float squared_reach_m2) : distance2_(squared_reach_m2) {}
  bool full() const { return true; }
  bool addPoint(float distance2, std::uint32_t index) {
    if (distance2 < distance2_) {
      distance2_ = distance2;
      index_ = index;
      found_ = true;
    }
    return true;
  }
  float worstDist() const { return distance2_; }
  SurfaceCloud::Neighbour result() const {
    return {index_, found_ ? distance2_ : std::numeric_limits<float>::infinity()};
  }

 private:
  float distance2_;
  std::uint32_t index_ = 0;
  bool found_ = false;
};

}  // namespace

SurfaceCloud::Neighbour SurfaceCloud::nearest(const Eigen::Vector3f& query, float squared_reach_m2) const {
  NearestWithin within(squared_reach_m2);
  if (tree_->index) tree_->index->findNeighbors(within, query.data(), nanoflann::SearchParams());
  return within.result();
}

std::vector<SurfaceCloud::Neighbour> SurfaceCloud::nearest(const Eigen::Vector3f& query, std::size_t k) const {
  std::vector<std::uint32_t> indices(k);
  std::vector<float> distances(k);
  const std::size_t found =
      tree_->index ? tree_->index->knnSearch(query.data(), k, indices.data(), distances.data()) : 0;
  std::vector<Neighbour> result;
  for (std::size_t i = 0; i < found; ++i) result.push_back({indices[i], distances[i]});
  return result;
}

}  // namespace revisit
