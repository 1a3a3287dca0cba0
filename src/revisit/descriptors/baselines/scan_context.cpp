// SPDX-License-Identifier: Apache-2.0
// Kim and Kim, "Scan Context: Egocentric Spatial Descriptor for Place Recognition within 3D Point Cloud Map",
// IROS 2018: the distance of two scans is the mean cosine distance of their columns (eq. 6) at the best of all column
// shifts (eq. 7); the ring key finds those that are compared (section III-C). The key is the mean height of a ring, as
// in the authors' program, with which its figures were reached (in the paper: the share of its cells that are
// occupied).
#include <algorithm>
#include <cmath>

#include <revisit/core/pose.hpp>
#include <revisit/descriptors/internal/baselines.hpp>
#include <revisit/descriptors/internal/polar_heights.hpp>

namespace revisit::descriptors_internal {
namespace {

constexpr int kRings = 20, kSectors = 60;
constexpr float kMaxRange_m = 80.f;
constexpr float kBelowGround_m = 0.27f;  // the program adds 2 m to the heights of a sensor 1.73 m above the ground

class ScanContext final : public TurnMethod {
 public:
  explicit ScanContext(std::size_t nearest_ring_keys) : TurnMethod(kSectors), nearest_ring_keys_(nearest_ring_keys) {}

  std::string name() const override { return nearest_ring_keys_ == 0 ? "scan-context" : "scan-context-ring-key"; }
  std::string source() const override {
    return nearest_ring_keys_ == 0 ? "Kim and Kim, IROS 2018; every place compared"
                                   : "Kim and Kim, IROS 2018; the ten places of nearest ring key compared";
  }

  Signature describe(std::span<const Point> points, double ground_z_m) const override {
    return {polar_heights(points, ground_z_m), {}};
  }

  Eigen::VectorXf key(const Signature& signature) const override {
    if (nearest_ring_keys_ == 0) return {};
    return signature.values.rowwise().mean();
  }
  std::size_t nearest_keys() const override { return nearest_ring_keys_; }

 private:
  Turn best_turn(const Signature& query, const Signature& place) const override {
    // Columns of unit length, so that a cosine is one product; empty columns stay zero.
    const Eigen::VectorXf query_scale = inverse_lengths(query.values), place_scale = inverse_lengths(place.values);
    const Eigen::Matrix<float, kSectors, kSectors> cosines =
        query_scale.asDiagonal() * (query.values.transpose() * place.values) * place_scale.asDiagonal();
    Turn best;
    for (int shift = 0; shift < kSectors; ++shift) {
      // A cosine with an empty column is not defined: such pairs do not count.
      double sum = 0.0;
      int columns = 0;
      for (int j = 0; j < kSectors; ++j) {
        const int k = j + shift < kSectors ? j + shift : j + shift - kSectors;
        sum += static_cast<double>(cosines(j, k));
        columns += query_scale[j] > 0.f && place_scale[k] > 0.f;
      }
      if (columns > 0 && sum / columns > best.similarity) best = {sum / columns, shift};
    }
    return best;
  }

  std::size_t nearest_ring_keys_;
};

}  // namespace

Eigen::MatrixXf polar_heights(std::span<const Point> points, double ground_z_m, float left_m) {
  Eigen::MatrixXf image = Eigen::MatrixXf::Zero(kRings, kSectors);
  const float lowest_m = static_cast<float>(ground_z_m) - kBelowGround_m;
  for (const Point& p : points) {
    const float y = p.y - left_m;
    const float range_m = std::hypot(p.x, y);
    if (!(range_m < kMaxRange_m)) continue;
    const int ring = static_cast<int>(range_m * kRings / kMaxRange_m);
    const float turns = (std::atan2(y, p.x) + static_cast<float>(kPi)) / static_cast<float>(2.0 * kPi);
    const int sector = std::min(static_cast<int>(turns * kSectors), kSectors - 1);
    image(ring, sector) = std::max(image(ring, sector), p.z - lowest_m);
  }
  return image;
}

Eigen::VectorXf inverse_lengths(const Eigen::MatrixXf& image) {
  return image.colwise().norm().unaryExpr([](float n) { return n > 0.f ? 1.f / n : 0.f; });
}

std::unique_ptr<Baseline> make_scan_context(std::size_t nearest_ring_keys) {
  return std::make_unique<ScanContext>(nearest_ring_keys);
}

}  // namespace revisit::descriptors_internal
