// SPDX-License-Identifier: Apache-2.0
// Yuan, Lin, Zou, Hong and Zhang, "STD: Stable Triangle Descriptor for 3D Place Recognition", ICRA 2023: scans of a
// while, put together, are cut into cubes of 2 m. What is not flat beside a flat one is seen along its normal, as an
// image of 0.5 m whose pixels say how far from the plane the farthest point lies (up to 5 m); where one is the highest
// of 5 x 5 there is a keypoint, the mean of its points. The 100 with the most points make triangles with their ten
// neighbours (triangles.hpp). Here each flat cube is a plane by itself (merged planes found fewer places again), and
// cubes are cut in the frame of the last scan; the published program cuts them in the world's, where poses that are
// exact make them the same ones at the next visit.
#include <algorithm>
#include <cmath>
#include <map>
#include <utility>
#include <vector>

#include <revisit/descriptors/internal/baselines.hpp>
#include <revisit/descriptors/internal/triangles.hpp>

namespace revisit::descriptors_internal {
namespace stable_triangle {
namespace {

constexpr std::size_t kKeypoints = 100;
constexpr float kVoxel_m = 2.f, kFlat_m2 = 0.01f, kPixel_m = 0.5f, kHighest_m = 5.f, kApart_m = 2.f;
constexpr int kFewestPoints = 10, kAround = 2;
constexpr TriangleOptions kTriangles{10, 50.f};

struct Candidate {
  TriangleKeypoint keypoint;
  int points = 0;
};

struct Pixel {
  float height_m = 0.f;
  int points = 0;
  Eigen::Vector3f sum = Eigen::Vector3f::Zero();
};
using Image = std::map<std::pair<int, int>, Pixel>;

void project(const SurfaceVoxel& plane, const std::vector<Eigen::Vector3f>& points, Image& image) {
  const Eigen::Vector3f right = plane.normal.unitOrthogonal(), ahead = plane.normal.cross(right);
  for (const Eigen::Vector3f& point : points) {
    const Eigen::Vector3f off = point - plane.centre;
    const float height_m = std::abs(off.dot(plane.normal));
    if (height_m > kHighest_m) continue;
    const auto cell = [&](const Eigen::Vector3f& axis) {
      return static_cast<int>(std::floor(off.dot(axis) / kPixel_m));
    };
    Pixel& pixel = image[{cell(right), cell(ahead)}];
    ++pixel.points;
    pixel.sum += point;
    pixel.height_m = std::max(pixel.height_m, height_m);
  }
}

Image image_beside(const std::vector<SurfaceVoxel>& voxels, const SurfaceVoxel& plane) {
  const auto before = [](const SurfaceVoxel& voxel, const Eigen::Vector3i& cell) {
    return std::lexicographical_compare(voxel.cell.begin(), voxel.cell.end(), cell.begin(), cell.end());
  };
  Image image;
  for (int i = -1; i <= 1; ++i)
    for (int j = -1; j <= 1; ++j) {
      const Eigen::Vector3i lowest = plane.cell + Eigen::Vector3i(i, j, -1);
      auto voxel = std::lower_bound(voxels.begin(), voxels.end(), lowest, before);
      for (; voxel != voxels.end() && voxel->cell.head<2>() == lowest.head<2>() && voxel->cell.z() <= lowest.z() + 2;
           ++voxel)
        if (!voxel->is_flat()) project(plane, voxel->points, image);
    }
  return image;
}

bool is_highest(const Image& image, const Image::value_type& of) {
  for (int i = -kAround; i <= kAround; ++i)
    for (int j = -kAround; j <= kAround; ++j) {
      const auto other = image.find({of.first.first + i, of.first.second + j});
      if ((i != 0 || j != 0) && other != image.end() && other->second.height_m >= of.second.height_m) return false;
    }
  return true;
}

void add_keypoints(const std::vector<SurfaceVoxel>& voxels, const SurfaceVoxel& plane, std::vector<Candidate>& found) {
  const Image image = image_beside(voxels, plane);
  for (const auto& each : image)
    if (each.second.points >= kFewestPoints && is_highest(image, each))
      found.push_back({{each.second.sum / static_cast<float>(each.second.points), plane.normal}, each.second.points});
}

class StableTriangle final : public TriangleMethod {
 public:
  std::string name() const override { return "std"; }
  std::string source() const override { return "Yuan et al., ICRA 2023; of the last ten scans"; }

  Signature describe(std::span<const Point> points, double) const override {
    const std::vector<SurfaceVoxel> voxels = surface_voxels(points, kVoxel_m, kFlat_m2);
    std::vector<Candidate> found;
    for (const SurfaceVoxel& voxel : voxels)
      if (voxel.is_flat()) add_keypoints(voxels, voxel, found);
    std::stable_sort(found.begin(), found.end(),
                     [](const Candidate& a, const Candidate& b) { return a.points > b.points; });
    std::vector<TriangleKeypoint> keypoints;
    for (const Candidate& each : found) {
      if (keypoints.size() == kKeypoints) break;
      if (std::none_of(keypoints.begin(), keypoints.end(), [&](const TriangleKeypoint& other) {
            return (other.position - each.keypoint.position).norm() < kApart_m;
          }))
        keypoints.push_back(each.keypoint);
    }
    return triangle_signature(keypoints, voxels, kTriangles);
  }
};

}  // namespace
}  // namespace stable_triangle

std::unique_ptr<Baseline> make_stable_triangle() { return std::make_unique<stable_triangle::StableTriangle>(); }

}  // namespace revisit::descriptors_internal
