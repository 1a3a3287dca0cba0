// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <stdexcept>

#include <oneapi/tbb/parallel_invoke.h>

#include <revisit/core/fast_math.hpp>
#include <revisit/registration/surface_cloud.hpp>

namespace revisit {
namespace {

// Cells along an axis; what lies farther out shares the outermost one.
class Axis {
 public:
  Axis(float cell_m, float lowest_m, float highest_m)
      : per_m_(1.f / cell_m), first_(absolute(lowest_m)), last_(absolute(highest_m)) {}
  std::uint32_t cell(float metres) const { return static_cast<std::uint32_t>(absolute(metres) - first_); }
  std::uint32_t cells() const { return static_cast<std::uint32_t>(last_ - first_ + 1); }

 private:
  int absolute(float metres) const {
    constexpr float kFarthest = 1024.f;
    return floor_to_int(std::clamp(metres * per_m_, -kFarthest, kFarthest));
  }
  float per_m_;
  int first_, last_;
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

ThinCloud thin_for_registration(std::span<const Point> points, std::span<const std::uint8_t> is_ground) {
  constexpr double kVoxel_m = 1.0, kSmall_m = 0.5;
  constexpr std::size_t kFewest = 1500;  // streets fill 1,800 to 5,000, rooms and halls 50 to 1,400
  ThinCloud cloud = thin(points, is_ground, kVoxel_m);
  if (cloud.points.size() >= kFewest) return cloud;
  ThinCloud fine = thin_surfaces(points, is_ground, kSmall_m);
  fine.seen = std::move(cloud.seen);
  return fine;
}

ThinCloud thin_surfaces(std::span<const Point> points, std::span<const std::uint8_t> is_ground, double voxel_m) {
  if (!(voxel_m > 0.0)) throw std::invalid_argument("voxels of " + std::to_string(voxel_m) + " m; allowed: above 0");
  ThinCloud cloud;
  cloud.voxel_m = static_cast<float>(voxel_m);
  if (points.empty()) return cloud;
  Eigen::Array4f lowest = Eigen::Array4f::Map(&points[0].x), highest = lowest;
  for (const Point& p : points) {
    const auto xyz = Eigen::Array4f::Map(&p.x);
    lowest = lowest.min(xyz);
    highest = highest.max(xyz);
  }
  const auto axis = [&](int i) { return Axis(cloud.voxel_m, lowest[i], highest[i]); };
  const Axis x = axis(0), y = axis(1), z = axis(2);
  // Points are sorted by vertical columns (counting sort), then gathered by height, a column at a time.
  std::vector<std::uint32_t> column_of(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) column_of[i] = x.cell(points[i].x) * y.cells() + y.cell(points[i].y);
  std::vector<std::uint32_t> begin(std::size_t{x.cells()} * y.cells() + 1);
  for (const std::uint32_t c : column_of) ++begin[c + 1];
  for (std::size_t c = 1; c < begin.size(); ++c) begin[c] += begin[c - 1];
  std::vector<std::uint32_t> sorted(points.size());
  {
    std::vector<std::uint32_t> next(begin.begin(), begin.end() - 1);
    for (std::size_t i = 0; i < points.size(); ++i) sorted[next[column_of[i]]++] = static_cast<std::uint32_t>(i);
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
