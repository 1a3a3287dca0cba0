// SPDX-License-Identifier: Apache-2.0
#include <revisit/simulation/internal/terrain.hpp>

#include <algorithm>
#include <cmath>

#include <revisit/simulation/internal/random.hpp>

namespace revisit::simulation_internal {
namespace {

// A grid of weighted sums.
struct Layer {
  int columns = 0, rows = 0;
  std::vector<double> sum, weight;

  Layer(int c, int r) : columns(c), rows(r), sum(size()), weight(size()) {}
  std::size_t size() const { return static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows); }
  std::size_t index(int c, int r) const {
    return static_cast<std::size_t>(std::clamp(r, 0, rows - 1)) * static_cast<std::size_t>(columns) +
           static_cast<std::size_t>(std::clamp(c, 0, columns - 1));
  }
};

// Values spread from where there are some to where there are none: averaged in ever coarser layers, and filled back.
void fill_gaps(Layer& fine) {
  if (fine.columns > 1 || fine.rows > 1) {
    Layer coarse((fine.columns + 1) / 2, (fine.rows + 1) / 2);
    for (int r = 0; r < fine.rows; ++r)
      for (int c = 0; c < fine.columns; ++c) {
        const double w = std::min(1.0, fine.weight[fine.index(c, r)]);
        if (w <= 0.0) continue;
        coarse.sum[coarse.index(c / 2, r / 2)] += w * fine.sum[fine.index(c, r)] / fine.weight[fine.index(c, r)];
        coarse.weight[coarse.index(c / 2, r / 2)] += w;
      }
    fill_gaps(coarse);
    for (int r = 0; r < fine.rows; ++r)
      for (int c = 0; c < fine.columns; ++c) {
        double& weight = fine.weight[fine.index(c, r)];
        if (weight >= 1.0) continue;
        const std::size_t from = coarse.index(c / 2, r / 2);
        fine.sum[fine.index(c, r)] += (1.0 - weight) * coarse.sum[from] / coarse.weight[from];
        weight = 1.0;
      }
  }
}

void smooth(Layer& layer, int passes) {
  for (std::size_t i = 0; i < layer.size(); ++i) layer.sum[i] /= layer.weight[i];
  std::vector<double> blurred(layer.size());
  for (int pass = 0; pass < passes; ++pass) {
    for (const bool along_x : {true, false}) {
      for (int r = 0; r < layer.rows; ++r)
        for (int c = 0; c < layer.columns; ++c) {
          const int dc = along_x ? 1 : 0, dr = along_x ? 0 : 1;
          blurred[layer.index(c, r)] = 0.25 * layer.sum[layer.index(c - dc, r - dr)] +
                                       0.5 * layer.sum[layer.index(c, r)] +
                                       0.25 * layer.sum[layer.index(c + dc, r + dr)];
        }
      layer.sum.swap(blurred);
    }
  }
}

// Distance of each vertex to the nearest marked one, in cells; two sweeps over the grid.
std::vector<float> distances(const Layer& layer, const std::vector<std::uint8_t>& marked) {
  std::vector<float> distance(layer.size(), 1e6f);
  for (std::size_t i = 0; i < layer.size(); ++i)
    if (marked[i] != 0) distance[i] = 0.f;
  const auto relax = [&](int c, int r, int dc, int dr, float step) {
    if (c + dc < 0 || c + dc >= layer.columns || r + dr < 0 || r + dr >= layer.rows) return;
    float& here = distance[layer.index(c, r)];
    here = std::min(here, distance[layer.index(c + dc, r + dr)] + step);
  };
  const float diagonal = std::sqrt(2.f);
  for (const int sweep : {1, -1})
    for (int row = 0; row < layer.rows; ++row)
      for (int column = 0; column < layer.columns; ++column) {
        const int r = sweep > 0 ? row : layer.rows - 1 - row, c = sweep > 0 ? column : layer.columns - 1 - column;
        relax(c, r, -sweep, 0, 1.f);
        relax(c, r, 0, -sweep, 1.f);
        relax(c, r, -sweep, -sweep, diagonal);
        relax(c, r, sweep, -sweep, diagonal);
      }
  return distance;
}

}  // namespace

Terrain::Terrain(const Path& path, double reach_m, double hills_m, std::uint64_t seed) {
  double x_max = path.knots().front().x, y_max = path.knots().front().y;
  x_min_ = x_max;
  y_min_ = y_max;
  for (const Knot& knot : path.knots()) {
    x_min_ = std::min(x_min_, knot.x);
    x_max = std::max(x_max, knot.x);
    y_min_ = std::min(y_min_, knot.y);
    y_max = std::max(y_max, knot.y);
  }
  x_min_ = kCell_m * std::floor((x_min_ - reach_m) / kCell_m);
  y_min_ = kCell_m * std::floor((y_min_ - reach_m) / kCell_m);
  columns_ = static_cast<int>((x_max + reach_m - x_min_) / kCell_m) + 2;
  rows_ = static_cast<int>((y_max + reach_m - y_min_) / kCell_m) + 2;

  Layer layer(columns_, rows_);
  std::vector<std::uint8_t> on_path(layer.size());
  constexpr int kReach = 3;  // vertices beside the path that it sets itself, all passes averaged
  for (const Knot& knot : path.knots()) {
    const double u = (knot.x - x_min_) / kCell_m, v = (knot.y - y_min_) / kCell_m;
    const int column = static_cast<int>(u), row = static_cast<int>(v);
    on_path[layer.index(column, row)] = 1;
    for (int dr = -kReach; dr <= kReach; ++dr)
      for (int dc = -kReach; dc <= kReach; ++dc) {
        const double distance2 = std::pow(column + dc - u, 2) + std::pow(row + dr - v, 2);
        const double weight = std::exp(-0.5 * distance2);
        layer.sum[layer.index(column + dc, row + dr)] += weight * knot.ground_z;
        layer.weight[layer.index(column + dc, row + dr)] += weight;
      }
  }
  fill_gaps(layer);
  smooth(layer, 12);

  const std::vector<float> distance = distances(layer, on_path);
  heights_.resize(layer.size());
  for (int r = 0; r < rows_; ++r)
    for (int c = 0; c < columns_; ++c) {
      const double away_m = kCell_m * static_cast<double>(distance[layer.index(c, r)]);
      const double x = x_min_ + kCell_m * c, y = y_min_ + kCell_m * r,
                   ramp = std::clamp((away_m - 25.0) / 60.0, 0.0, 1.0);
      const double hill = hills_m * ramp * ramp * (0.4 + smooth_noise(seed, x / 70.0, y / 70.0));
      vertex(c, r) = static_cast<float>(layer.sum[layer.index(c, r)] + hill);
    }
  for (int r = 0; r + 1 < rows_; ++r)
    for (int c = 0; c + 1 < columns_; ++c)
      if (kCell_m * static_cast<double>(distance[layer.index(c, r)]) < reach_m)
        cells_.push_back({static_cast<float>(x_min_ + kCell_m * c), static_cast<float>(y_min_ + kCell_m * r),
                          vertex(c, r), vertex(c + 1, r), vertex(c, r + 1), vertex(c + 1, r + 1)});
}

double Terrain::height(double x, double y) const {
  const double u = std::clamp((x - x_min_) / kCell_m, 0.0, columns_ - 1.001);
  const double v = std::clamp((y - y_min_) / kCell_m, 0.0, rows_ - 1.001);
  const int c = static_cast<int>(u), r = static_cast<int>(v);
  const double a = u - c, b = v - r, h00 = static_cast<double>(vertex(c, r)),
               h10 = static_cast<double>(vertex(c + 1, r)), h01 = static_cast<double>(vertex(c, r + 1)),
               h11 = static_cast<double>(vertex(c + 1, r + 1));
  return a >= b ? h00 + (h10 - h00) * a + (h11 - h10) * b : h00 + (h11 - h01) * a + (h01 - h00) * b;
}

float intersect(const Terrain::Cell& cell, const Ray& ray, float limit_m, Eigen::Vector3f* normal) {
  constexpr auto kSize = static_cast<float>(Terrain::kCell_m);
  constexpr float kEdge = 1e-4f;  // neighbours overlap by this share, so that no ray slips between them
  const float x = ray.origin.x() - cell.x, y = ray.origin.y() - cell.y;
  for (const bool lower : {true, false}) {
    const float slope_x = (lower ? cell.h10 - cell.h00 : cell.h11 - cell.h01) / kSize;
    const float slope_y = (lower ? cell.h11 - cell.h10 : cell.h01 - cell.h00) / kSize;
    const float above = ray.origin.z() - cell.h00 - slope_x * x - slope_y * y;
    const float sinking = slope_x * ray.direction.x() + slope_y * ray.direction.y() - ray.direction.z();
    if (!(sinking > 0.f && above > 0.f)) continue;
    const float t = above / sinking;
    if (!(t < limit_m)) continue;
    const float u = (x + t * ray.direction.x()) / kSize, v = (y + t * ray.direction.y()) / kSize;
    if (u < -kEdge || u > 1.f + kEdge || v < -kEdge || v > 1.f + kEdge) continue;
    if (lower ? u < v - kEdge : v < u - kEdge) continue;
    if (normal != nullptr) *normal = Eigen::Vector3f(-slope_x, -slope_y, 1.f).normalized();
    return t;
  }
  return std::numeric_limits<float>::infinity();
}

}  // namespace revisit::simulation_internal
