// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <oneapi/tbb/parallel_invoke.h>

#include <revisit/registration/surface_cloud.hpp>

namespace revisit {
namespace {

// Cells along an axis; what lies farther out shares the outermost one.
class Axis {
 public:
  explicit Axis(float cell_m) : per_m_(1.f / cell_m) {}
  void include(float metres) {
    first_ = std::min(first_, absolute(metres));
    last_ = std::max(last_, absolute(metres));
  }
  std::size_t cell(float metres) const { return static_cast<std::size_t>(absolute(metres) - first_); }
  std::size_t cells() const { return static_cast<std::size_t>(last_) - static_cast<std::size_t>(first_) + 1; }

 private:
  int absolute(float metres) const {
    constexpr float kFarthest = 1024.f;
    return static_cast<int>(std::floor(std::clamp(metres * per_m_, -kFarthest, kFarthest)));
  }
  float per_m_;
  int first_ = 2000, last_ = -2000;
};

struct Voxel {
  Eigen::Vector3f sum = Eigen::Vector3f::Zero();
  float intensity = 0.f;
  std::uint32_t count = 0, ground = 0;
};

}  // namespace

ThinCloud thin(std::span<const Point> points, std::span<const std::uint8_t> is_ground, double voxel_m) {
  ThinCloud cloud;
  SeenSpace seen;
  tbb::parallel_invoke([&] { cloud = thin_surfaces(points, is_ground, voxel_m); },
                       [&] {
                         if (!points.empty()) seen = SeenSpace(points);
                       });
  cloud.seen = std::move(seen);
  return cloud;
}

ThinCloud thin_surfaces(std::span<const Point> points, std::span<const std::uint8_t> is_ground, double voxel_m) {
  if (!(voxel_m > 0.0)) throw std::invalid_argument("voxels of " + std::to_string(voxel_m) + " m; allowed: above 0");
  ThinCloud cloud;
  cloud.voxel_m = static_cast<float>(voxel_m);
  if (points.empty()) return cloud;
  Axis x(cloud.voxel_m), y(cloud.voxel_m), z(cloud.voxel_m);
  for (const Point& p : points) {
    x.include(p.x);
    y.include(p.y);
    z.include(p.z);
  }
  // Points are sorted by vertical columns (counting sort), then gathered by height, a column at a time.
  std::vector<std::uint32_t> begin(x.cells() * y.cells() + 1);
  const auto column_of = [&](const Point& p) { return x.cell(p.x) * y.cells() + y.cell(p.y); };
  for (const Point& p : points) ++begin[column_of(p) + 1];
  for (std::size_t c = 1; c < begin.size(); ++c) begin[c] += begin[c - 1];
  std::vector<std::uint32_t> sorted(points.size());
  {
    std::vector<std::uint32_t> next(begin.begin(), begin.end() - 1);
    for (std::size_t i = 0; i < points.size(); ++i)
      sorted[next[column_of(points[i])]++] = static_cast<std::uint32_t>(i);
  }
  std::vector<Voxel> column(z.cells());
  std::vector<std::size_t> heights;
  for (std::size_t c = 0; c + 1 < begin.size(); ++c) {
    if (begin[c] == begin[c + 1]) continue;
    heights.clear();
    for (std::uint32_t at = begin[c]; at < begin[c + 1]; ++at) {
      const Point& p = points[sorted[at]];
      const std::size_t height = z.cell(p.z);
      Voxel& voxel = column[height];
      if (voxel.count == 0) heights.push_back(height);
      voxel.sum += Eigen::Vector3f(p.x, p.y, p.z);
      voxel.intensity += p.intensity;
      ++voxel.count;
      if (!is_ground.empty()) voxel.ground += is_ground[sorted[at]];
    }
    std::sort(heights.begin(), heights.end());
    for (const std::size_t height : heights) {
      Voxel& voxel = column[height];
      cloud.points.push_back(voxel.sum / static_cast<float>(voxel.count));
      cloud.intensity.push_back(voxel.intensity / static_cast<float>(voxel.count));
      cloud.is_ground.push_back(2 * voxel.ground > voxel.count);
      voxel = {};
    }
  }
  return cloud;
}

}  // namespace revisit
