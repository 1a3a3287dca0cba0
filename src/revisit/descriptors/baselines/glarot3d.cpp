// SPDX-License-Identifier: Apache-2.0
// Lodi Rizzini, "Place Recognition of 3D Landmarks based on Geometric Relations", IROS 2017 (GLAROT-3D): the vectors
// between all pairs of keypoints are counted by length and direction, directions by the cells of a cube around a
// sphere; two histograms are compared by L1 distance at the best rotation. What the paper leaves open is chosen here:
// keypoints are the 100 most upright things (cells of 1 m with the most height in them among their neighbours, up to 50
// m away), lengths have 20 bins of 2 m, a face of the cube 4 x 4 cells; rotations are those about the vertical by a
// cell of the cube (22.5 degrees), since what carries the sensor drives.
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include <revisit/core/pose.hpp>
#include <revisit/descriptors/internal/baselines.hpp>

namespace revisit::descriptors_internal {
namespace {

constexpr int kCells = 100, kAround = 2, kKeypoints = 100, kLengths = 20, kFace = 4, kDirections = 6 * kFace * kFace;
constexpr int kTurns = 4 * kFace;
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
    const int i = cell(p.x), j = cell(p.y);
    if (std::min(i, j) < 0 || std::max(i, j) >= kCells) continue;
    Column& column = columns[static_cast<std::size_t>(i * kCells + j)];
    const float up = p.z - ground_z_m;
    column.low = column.count > 0.f ? std::min(column.low, up) : up;
    column.high = column.count > 0.f ? std::max(column.high, up) : up;
    column.sum += Eigen::Vector3f(p.x, p.y, up);
    column.count += 1.f;
  }
  const auto height = [&](int i, int j) { return columns[static_cast<std::size_t>(i * kCells + j)].height(); };
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
      const Column& column = columns[static_cast<std::size_t>(i * kCells + j)];
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

// The cell of the cube that a direction meets, and the middle of a cell.
int cell_of(const Eigen::Vector3f& direction) {
  Eigen::Index axis = 0;
  const float length = direction.cwiseAbs().maxCoeff(&axis);
  const int face = 2 * static_cast<int>(axis) + (direction[axis] < 0.f);
  const auto cell = [&](Eigen::Index i) {
    return std::clamp(static_cast<int>((direction[(axis + i) % 3] / length + 1.f) * kFace / 2), 0, kFace - 1);
  };
  return (face * kFace + cell(1)) * kFace + cell(2);
}
Eigen::Vector3f middle_of(int cell) {
  const int face = cell / (kFace * kFace), axis = face / 2;
  const auto place = [](int i) { return (static_cast<float>(i) + 0.5f) * 2.f / kFace - 1.f; };
  Eigen::Vector3f direction;
  direction[axis] = face % 2 == 0 ? 1.f : -1.f;
  direction[(axis + 1) % 3] = place(cell / kFace % kFace);
  direction[(axis + 2) % 3] = place(cell % kFace);
  return direction;
}

// Which cell each becomes, for each turn about the vertical.
std::array<std::array<Eigen::Index, kDirections>, kTurns> make_turns() {
  std::array<std::array<Eigen::Index, kDirections>, kTurns> turned{};
  for (int turn = 0; turn < kTurns; ++turn)
    for (int cell = 0; cell < kDirections; ++cell) {
      const auto angle = static_cast<float>(2.0 * kPi * turn / kTurns);
      turned[static_cast<std::size_t>(turn)][static_cast<std::size_t>(cell)] =
          cell_of(Eigen::AngleAxisf(angle, Eigen::Vector3f::UnitZ()) * middle_of(cell));
    }
  return turned;
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
    float least = 2.f;
    for (const auto& turned : turns_) {
      float difference = 0.f;
      for (Eigen::Index cell = 0; cell < kDirections; ++cell)
        difference +=
            (query.values.col(cell) - place.values.col(turned[static_cast<std::size_t>(cell)])).cwiseAbs().sum();
      least = std::min(least, difference);
    }
    return 1.0 - static_cast<double>(least) / 2.0;
  }

 private:
  const std::array<std::array<Eigen::Index, kDirections>, kTurns> turns_ = make_turns();
};

}  // namespace

std::unique_ptr<Baseline> make_glarot3d() { return std::make_unique<Glarot3d>(); }

}  // namespace revisit::descriptors_internal
