// SPDX-License-Identifier: Apache-2.0
// Lu, Xu, Chen, Xiong and Wang, "One RING to Rule Them All: Radon Sinogram for Place Recognition, Orientation and
// Translation Estimation", RA-L 2022: the Radon transform of what is occupied seen from above (120 x 120 cells, 140 m
// across), 120 angles by 120 offsets; the magnitudes of its Fourier transform along the offsets do not change where the
// sensor is moved; turned places are found by circular correlation along the angles. Half a turn holds all angles: the
// magnitudes repeat. Points from half a metre above the ground count.
#include <algorithm>
#include <cmath>
#include <vector>

#include <revisit/core/pose.hpp>
#include <revisit/descriptors/internal/baselines.hpp>
#include <revisit/descriptors/internal/circular_correlation.hpp>

namespace revisit::descriptors_internal {
namespace {

constexpr int kCells = 120, kAngles = 120, kOffsets = 120, kFrequencies = kOffsets / 2;
constexpr float kReach_m = 70.f, kAboveGround_m = 0.5f;

// Centres of the occupied cells, in units of the reach.
std::vector<Eigen::Vector2f> occupied_cells(std::span<const Point> points, float lowest_m) {
  std::vector<bool> is_occupied(std::size_t{kCells} * kCells);
  std::vector<Eigen::Vector2f> cells;
  const auto cell = [](float metres) { return static_cast<int>(std::floor((metres / kReach_m + 1.f) * kCells / 2)); };
  const auto centre = [](int i) { return (static_cast<float>(i) + 0.5f) * 2.f / kCells - 1.f; };
  for (const Point& p : points) {
    if (p.z < lowest_m || !(std::abs(p.x) < kReach_m) || !(std::abs(p.y) < kReach_m)) continue;
    const int i = std::clamp(cell(p.x), 0, kCells - 1), j = std::clamp(cell(p.y), 0, kCells - 1);
    const auto index = static_cast<std::size_t>(i) * kCells + static_cast<std::size_t>(j);
    if (is_occupied[index]) continue;
    is_occupied[index] = true;
    cells.emplace_back(centre(i), centre(j));
  }
  return cells;
}

// Magnitudes by angle (a column) and frequency, but for that of the mean, which says only how many cells there are.
Eigen::MatrixXf magnitudes_of(const std::vector<Eigen::Vector2f>& cells) {
  Eigen::MatrixXf sums = Eigen::MatrixXf::Zero(kAngles, kOffsets);
  for (int angle = 0; angle < kAngles; ++angle) {
    const auto turn = static_cast<float>(kPi * angle / kAngles);
    const Eigen::Vector2f normal(std::cos(turn), std::sin(turn));
    for (const Eigen::Vector2f& cell : cells) {
      const float place = (normal.dot(cell) / std::sqrt(2.f) + 1.f) * kOffsets / 2;
      sums(angle, std::clamp(static_cast<int>(place), 0, kOffsets - 1)) += 1.f;
    }
  }
  const Eigen::MatrixXf spectra = spectra_of_rows(sums);
  const auto real = spectra.middleCols(1, kFrequencies).array();
  const auto imaginary = spectra.rightCols(kFrequencies).array();
  return (real.square() + imaginary.square()).sqrt().matrix().transpose();
}

class Ring final : public Baseline {
 public:
  std::string name() const override { return "ring"; }
  std::string source() const override { return "Lu et al., RA-L 2022"; }

  // Spectra along the angles, of magnitudes with mean 0 and length 1.
  Signature describe(std::span<const Point> points, double ground_z_m) const override {
    Eigen::MatrixXf magnitudes = magnitudes_of(occupied_cells(points, static_cast<float>(ground_z_m) + kAboveGround_m));
    magnitudes.array() -= magnitudes.mean();
    if (const float length = magnitudes.norm(); length > 0.f) magnitudes /= length;
    return {spectra_of_rows(magnitudes), {}};
  }

  double similarity(const Signature& query, const Signature& place) const override {
    return static_cast<double>(circular_correlation(query.values, place.values, kAngles).maxCoeff());
  }
};

}  // namespace

std::unique_ptr<Baseline> make_ring() { return std::make_unique<Ring>(); }

}  // namespace revisit::descriptors_internal
