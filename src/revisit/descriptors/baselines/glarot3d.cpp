// SPDX-License-Identifier: Apache-2.0
// Lodi Rizzini, "Place Recognition of 3D Landmarks based on Geometric Relations", IROS 2017 (GLAROT-3D): the vectors
// between all pairs of keypoints are counted by length and direction, directions by the cells of a cube around a
// sphere; two histograms are compared by L1 distance at the best rotation. What the paper leaves open is chosen here:
// keypoints are the 100 most upright things (cells of 1 m with the most height in them among their neighbours, up to 50
// m away), lengths have 20 bins of 2 m, an upright face of the cube 4 x 4 cells, the others one; rotations are those
// about the vertical by a cell of the cube (22.5 degrees), since what carries the sensor drives.
#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include <revisit/core/pose.hpp>
#include <revisit/descriptors/internal/baselines.hpp>

namespace revisit::descriptors_internal {
namespace glarot3d {
namespace {

constexpr int kCells = 100, kAround = 2, kKeypoints = 100, kLengths = 20, kFace = 4, kTurns = 4 * kFace;
constexpr Eigen::Index kSides = Eigen::Index{kTurns} * kFace, kDirections = kSides + 2;
constexpr float kLeastHeight_m = 1.f, kLength_m = 2.f;

std::vector<Eigen::Vector3f> keypoints_of(std::span<const Point> points, float ground_z_m) {
  struct Column {
    Eigen::Vector3f sum = Eigen::Vector3f::Zero();
    float count = 0.f, low = 0.f, high = 0.f;
    float height() const { return high - low; }
  };
  std::vector<Column> columns(std::size_t{kCells} * kCells);
  const auto cell = [](float metres) { return static_cast<int>(std::floor(metres)) + kCells / 2; };
  for (const Point& p : points) {
    constexpr float kReach_m = kCells / 2.f;
    if (!(std::abs(p.x) < kReach_m) || !(std::abs(p.y) < kReach_m)) continue;
    const int i = cell(p.x), j = cell(p.y);
    Column& column = columns[static_cast<std::size_t>(i) * kCells + static_cast<std::size_t>(j)];
    const float up = p.z - ground_z_m;
    column.low = column.count > 0.f ? std::min(column.low, up) : up;
    column.high = column.count > 0.f ? std::max(column.high, up) : up;
    column.sum += Eigen::Vector3f(p.x, p.y, up);
    column.count += 1.f;
  }
  const auto height = [&](int i, int j) {
    return columns[static_cast<std::size_t>(i) * kCells + static_cast<std::size_t>(j)].height();
  };
  std::vector<std::pair<float, Eigen::Vector3f>> found;
  for (int i = kAround; i + kAround < kCells; ++i)
    for (int j = kAround; j + kAround < kCells; ++j) {
      if (height(i, j) < kLeastHeight_m) continue;
      float around = 0.f, highest = 0.f;
      for (int di = -kAround; di <= kAround; ++di)
        for (int dj = -kAround; dj <= kAround; ++dj)
          if (di != 0 || dj != 0) {
            around += height(i + di, j + dj);
            if (std::max(std::abs(di), std::abs(dj)) == 1) highest = std::max(highest, height(i + di, j + dj));
          }
      const Column& column = columns[static_cast<std::size_t>(i) * kCells + static_cast<std::size_t>(j)];
      constexpr float kCellsAround = (2 * kAround + 1) * (2 * kAround + 1) - 1;
      if (column.height() >= highest)
        found.emplace_back(column.height() - around / kCellsAround, column.sum / column.count);
    }
  const std::size_t kept = std::min<std::size_t>(kKeypoints, found.size());
  std::partial_sort(found.begin(), found.begin() + static_cast<std::ptrdiff_t>(kept), found.end(),
                    [](const auto& a, const auto& b) { return a.first > b.first; });
  std::vector<Eigen::Vector3f> keypoints(kept);
  std::transform(found.begin(), found.begin() + static_cast<std::ptrdiff_t>(kept), keypoints.begin(),
                 [](const auto& each) { return each.second; });
  return keypoints;
}

// The cell of the cube that a direction meets: those of the four upright faces column by column, counter-clockwise,
// then the lid and the floor, which are one cell each.
Eigen::Index cell_of(const Eigen::Vector3f& direction) {
  const float across = direction.head<2>().cwiseAbs().maxCoeff();
  if (std::abs(direction.z()) > across) return kSides + (direction.z() < 0.f);
  const bool is_along_x = std::abs(direction.x()) == across;
  const float forward = is_along_x ? direction.x() : direction.y(), left = is_along_x ? direction.y() : -direction.x();
  const int face = (is_along_x ? 0 : 1) + (forward < 0.f ? 2 : 0);
  const auto cell = [](float share) { return std::clamp(static_cast<int>((share + 1.f) * kFace / 2), 0, kFace - 1); };
  const int column = face * kFace + cell(left / forward), row = cell(direction.z() / across);
  return Eigen::Index{column} * kFace + row;
}

class Glarot3d final : public Baseline {
 public:
  std::string name() const override { return "glarot3d"; }
  std::string source() const override { return "Lodi Rizzini, IROS 2017"; }

  // Lengths x directions, summing to 1.
  Signature describe(std::span<const Point> points, double ground_z_m) const override {
    const std::vector<Eigen::Vector3f> keypoints = keypoints_of(points, static_cast<float>(ground_z_m));
    Eigen::MatrixXf counts = Eigen::MatrixXf::Zero(kLengths, kDirections);
    for (std::size_t i = 0; i < keypoints.size(); ++i)
      for (std::size_t j = 0; j < keypoints.size(); ++j) {
        const Eigen::Vector3f between = keypoints[j] - keypoints[i];
        const auto length = static_cast<int>(between.norm() / kLength_m);
        if (i != j && length < kLengths && between.norm() > 0.f) counts(length, cell_of(between)) += 1.f;
      }
    if (const float sum = counts.sum(); sum > 0.f) counts /= sum;
    return {std::move(counts), {}};
  }

  // 1 - half the L1 distance: the share that both have.
  double similarity(const Signature& query, const Signature& place) const override {
    const float above = (query.values.rightCols<2>() - place.values.rightCols<2>()).cwiseAbs().sum();
    float least = 2.f;
    for (Eigen::Index turn = 0; turn < kTurns; ++turn) {
      const Eigen::Index shift = turn * kFace, rest = kSides - shift;
      const float difference = above +
                               (query.values.leftCols(rest) - place.values.middleCols(shift, rest)).cwiseAbs().sum() +
                               (query.values.middleCols(rest, shift) - place.values.leftCols(shift)).cwiseAbs().sum();
      least = std::min(least, difference);
    }
    return 1.0 - static_cast<double>(least) / 2.0;
  }
};

}  // namespace
}  // namespace glarot3d

std::unique_ptr<Baseline> make_glarot3d() { return std::make_unique<glarot3d::Glarot3d>(); }

}  // namespace revisit::descriptors_internal
