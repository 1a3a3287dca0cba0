// SPDX-License-Identifier: Apache-2.0
// Intensity Scan Context as the program published with the paper scores it, which is not what the paper says: points
// from 0.9 m below to 30 m above the sensor, up to 40 m; 20 rings x 60 sectors of 8-bit intensity, the largest in a
// cell; two cells agree in geometry where both are empty or both hold the value 1, the number one and not "anything";
// intensity is compared by absolute difference over all cells, at ten shifts either side of the best for geometry.
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <utility>

#include <revisit/core/pose.hpp>
#include <revisit/descriptors/internal/baselines.hpp>

namespace revisit::descriptors_internal {
namespace published_isc {
namespace {

constexpr int kRings = 20, kSectors = 60;
constexpr float kMaxRange_m = 40.f, kLowest_m = -0.9f, kHighest_m = 30.f;

int wrapped(int sector) { return (sector % kSectors + kSectors) % kSectors; }

// Bits of the cells of each column that hold a value.
std::array<std::uint32_t, kSectors> cells_that_hold(float value, const Eigen::MatrixXf& image) {
  std::array<std::uint32_t, kSectors> masks{};
  for (int j = 0; j < kSectors; ++j)
    for (int i = 0; i < kRings; ++i) masks[static_cast<std::size_t>(j)] |= std::uint32_t{image(i, j) == value} << i;
  return masks;
}

class PublishedIsc final : public TurnMethod {
 public:
  PublishedIsc() : TurnMethod(kSectors) {}
  std::string name() const override { return "isc-program"; }
  std::string source() const override { return "Wang et al., ICRA 2020, as in the published program"; }

  Signature describe(std::span<const Point> points, double) const override {
    Eigen::MatrixXf image = Eigen::MatrixXf::Zero(kRings, kSectors);
    for (const Point& p : points) {
      const float range_m = std::hypot(p.x, p.y);
      if (range_m >= kMaxRange_m || p.z < kLowest_m || p.z > kHighest_m) continue;
      const int ring = static_cast<int>(range_m * kRings / kMaxRange_m);
      const float turns = (std::atan2(p.y, p.x) + static_cast<float>(kPi)) / static_cast<float>(2.0 * kPi);
      const int sector = std::min(static_cast<int>(turns * kSectors), kSectors - 1);
      image(ring, sector) = std::max(image(ring, sector), std::floor(255.f * p.intensity));
    }
    return {std::move(image), {}};
  }

 private:
  Turn best_turn(const Signature& query_signature, const Signature& place_signature) const override {
    const Eigen::MatrixXf &query = query_signature.values, &place = place_signature.values;
    const auto empty_q = cells_that_hold(0.f, query), empty_p = cells_that_hold(0.f, place);
    const auto one_q = cells_that_hold(1.f, query), one_p = cells_that_hold(1.f, place);
    int geometry = -1, best_shift = 0;
    for (int shift = 0; shift < kSectors; ++shift) {
      int alike = 0;
      for (int j = 0; j < kSectors; ++j) {
        const auto a = static_cast<std::size_t>(j), b = static_cast<std::size_t>(wrapped(j + shift));
        alike += std::popcount((empty_q[a] & empty_p[b]) | (one_q[a] & one_p[b]));
      }
      if (alike > geometry) geometry = alike, best_shift = shift;
    }
    constexpr int kCells = kRings * kSectors;
    double intensity = 0.0;
    for (int shift = best_shift - 10; shift < best_shift + 10; ++shift) {
      const int first = wrapped(shift), rest = kSectors - first;
      const float difference = (query.leftCols(rest) - place.rightCols(rest)).cwiseAbs().sum() +
                               (query.rightCols(first) - place.leftCols(first)).cwiseAbs().sum();
      intensity = std::max(intensity, 1.0 - static_cast<double>(difference) / (255.0 * kCells));
    }
    return {static_cast<double>(geometry) / kCells + intensity, best_shift};
  }
};

}  // namespace
}  // namespace published_isc

std::unique_ptr<Baseline> make_published_isc() { return std::make_unique<published_isc::PublishedIsc>(); }

}  // namespace revisit::descriptors_internal
