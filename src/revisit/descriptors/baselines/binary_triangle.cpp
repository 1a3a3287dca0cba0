// SPDX-License-Identifier: Apache-2.0
// Yuan, Lin, Liu, Wei, Hong and Zhang, "BTC: A Binary and Triangle Combined Descriptor for 3-D Place Recognition",
// T-RO 2024: scans of a while, put together, are seen along the normal of a reference plane, in pixels of 0.5 m; which
// steps of 0.1 m above it hold points is a pixel's binary code. Where a code has the most ones of 5 x 5 (eight and
// more) is a keypoint, unless it has the like on both sides; the 100 of most ones make triangles with their 15
// neighbours, which agree where their corners' codes do (triangles.hpp). The reference plane is the ground here (in the
// paper: the largest plane that is found).
#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>
#include <vector>

#include <revisit/descriptors/internal/baselines.hpp>
#include <revisit/descriptors/internal/triangles.hpp>

namespace revisit::descriptors_internal {
namespace binary_triangle {
namespace {

constexpr std::size_t kKeypoints = 60;
constexpr int kCells = 240, kAround = 2, kFewestOnes = 8;
constexpr float kPixel_m = 0.5f, kReach_m = kCells * kPixel_m / 2.f, kLowest_m = 0.2f, kStep_m = 0.1f, kHighest_m = 5.f;
constexpr float kVoxel_m = 2.f, kFlat_m2 = 0.01f;
constexpr TriangleOptions kTriangles{10, 60.f};

struct Pixel {
  std::uint64_t code = 0;
  Eigen::Vector3f sum = Eigen::Vector3f::Zero();
  float points = 0.f;
};

std::vector<Pixel> image_of(std::span<const Point> points, float ground_z_m) {
  std::vector<Pixel> image(std::size_t{kCells} * kCells);
  for (const Point& p : points) {
    const float up_m = p.z - ground_z_m;
    if (!(std::abs(p.x) < kReach_m) || !(std::abs(p.y) < kReach_m) || !(up_m >= kLowest_m && up_m < kHighest_m))
      continue;
    const auto cell = [](float metres) {
      return static_cast<std::size_t>(std::min(static_cast<int>((metres + kReach_m) / kPixel_m), kCells - 1));
    };
    Pixel& pixel = image[cell(p.x) * kCells + cell(p.y)];
    pixel.code |= std::uint64_t{1} << static_cast<unsigned>((up_m - kLowest_m) / kStep_m);
    pixel.sum += Eigen::Vector3f(p.x, p.y, p.z);
    pixel.points += 1.f;
  }
  return image;
}

int ones(const std::vector<Pixel>& image, int i, int j) {
  return std::popcount(image[static_cast<std::size_t>(i) * kCells + static_cast<std::size_t>(j)].code);
}

// Walls go on to both sides.
bool is_on_line(const std::vector<Pixel>& image, int i, int j) {
  const int least = ones(image, i, j) * 4 / 5;
  for (const auto& [di, dj] : {std::pair(1, 0), std::pair(0, 1), std::pair(1, 1), std::pair(1, -1)})
    if (ones(image, i + di, j + dj) >= least && ones(image, i - di, j - dj) >= least) return true;
  return false;
}

std::vector<TriangleKeypoint> keypoints_of(const std::vector<Pixel>& image) {
  std::vector<std::pair<int, TriangleKeypoint>> found;
  for (int i = kAround; i + kAround < kCells; ++i)
    for (int j = kAround; j + kAround < kCells; ++j) {
      const int own = ones(image, i, j);
      if (own < kFewestOnes) continue;
      bool is_most = true;
      for (int row = i - kAround; row <= i + kAround && is_most; ++row)
        for (int column = j - kAround; column <= j + kAround && is_most; ++column)
          // Of equal ones the first counts.
          is_most = std::pair(row, column) < std::pair(i, j) ? ones(image, row, column) < own
                                                             : ones(image, row, column) <= own;
      const Pixel& pixel = image[static_cast<std::size_t>(i) * kCells + static_cast<std::size_t>(j)];
      if (is_most && !is_on_line(image, i, j))
        found.push_back({own, {pixel.sum / pixel.points, Eigen::Vector3f::UnitZ(), pixel.code}});
    }
  // Many have all ones: the nearest of them.
  const auto away = [](const auto& each) { return each.second.position.template head<2>().squaredNorm(); };
  std::stable_sort(found.begin(), found.end(), [&](const auto& a, const auto& b) {
    return a.first != b.first ? a.first > b.first : away(a) < away(b);
  });
  std::vector<TriangleKeypoint> keypoints;
  for (std::size_t i = 0; i < std::min(kKeypoints, found.size()); ++i) keypoints.push_back(found[i].second);
  return keypoints;
}

class BinaryTriangle final : public TriangleMethod {
 public:
  std::string name() const override { return "btc"; }
  std::string source() const override { return "Yuan et al., T-RO 2024; of the last ten scans"; }

  Signature describe(std::span<const Point> points, double ground_z_m) const override {
    return triangle_signature(keypoints_of(image_of(points, static_cast<float>(ground_z_m))),
                              surface_voxels(points, kVoxel_m, kFlat_m2), kTriangles);
  }
};

}  // namespace
}  // namespace binary_triangle

std::unique_ptr<Baseline> make_binary_triangle() { return std::make_unique<binary_triangle::BinaryTriangle>(); }

}  // namespace revisit::descriptors_internal
